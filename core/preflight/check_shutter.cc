// Compares the rows of images with each other: if they were exposed one after
// the other, the residuals of a point that moves in the image grow with its
// row. The states may follow any row, since a common delay is fitted as well,
// and each landmark is free to move.
#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "core/factor/keyframe_motion.h"
#include "core/factor/reprojection.h"
#include "core/model/median.h"
#include "core/preflight/checks.h"
#include "core/preflight/exposure_poses.h"

namespace selfcal {
namespace {

// A shorter readout is not a finding, nor one that is not significant: errors
// of a factory calibration look like up to 6 ms, and common rolling shutters
// take 10 ms and more.
constexpr double kMinReadout_s = 8e-3;
constexpr double kReadoutSigmas = 6;
// Readout of a common rolling shutter, which data must be able to show.
constexpr double kTold_s = 30e-3;
// Fewest observations, and keyframes on which they are.
constexpr std::size_t kMinSeen = 500;
constexpr int kMinKeyframes = 30;
// Observations of a landmark in a segment that say more than its position.
constexpr int kMinTrack = 3;
constexpr int kRounds = 5;
// The limit of Tukey's weights, in robust standard deviations.
constexpr double kTukey = 4.7;

// An observation: its residual, and its derivatives with respect to a delay of
// the image and of the rows, from the middle one in units of the image's
// height; all with those with respect to its landmark removed.
struct Row {
  int keyframe;  // over all segments
  Eigen::Vector2d r_px;
  Eigen::Matrix2d by_delay;  // [px/s]
};

using Track = std::vector<Row>;

struct Delays {
  Eigen::Vector2d value_s = Eigen::Vector2d::Zero();
  Eigen::Vector2d sigma_s = Eigen::Vector2d::Constant(HUGE_VAL);
};

// The rows of a landmark without what its position explains.
Track WithoutPosition(const Track& track, const Eigen::MatrixX3d& by_position) {
  const auto rows = static_cast<Eigen::Index>(2 * track.size());
  Eigen::MatrixX3d all(rows, 3);
  for (std::size_t i = 0; i < track.size(); ++i) {
    const auto at = static_cast<Eigen::Index>(2 * i);
    all.block<2, 1>(at, 0) = track[i].r_px;
    all.block<2, 2>(at, 1) = track[i].by_delay;
  }
  const Eigen::MatrixX3d left =
      all - by_position * by_position.colPivHouseholderQr().solve(all);
  Track result = track;
  for (std::size_t i = 0; i < track.size(); ++i) {
    const auto at = static_cast<Eigen::Index>(2 * i);
    result[i].r_px = left.block<2, 1>(at, 0);
    result[i].by_delay = left.block<2, 2>(at, 1);
  }
  return result;
}

// Collects the observations of a camera in valid segments.
class RowCollector {
 public:
  RowCollector(const Rig& rig, const Calibration& theta, int camera)
      : rig_(rig), theta_(theta), camera_(camera) {}

  void Add(const MotionSegment& segment, double late_s) {
    KeyframeMotions motions;
    const Calibration theta = FromStates(theta_, late_s);
    motions.Measure(rig_,
                    theta,
                    std::vector<char>(theta_.cameras.size(), 1),
                    segment.keyframes,
                    [&](std::size_t k) { return ContextOf(segment, k); });
    std::vector<std::vector<const Observation*>> tracks(
        segment.landmarks.size());
    for (const Observation& o : segment.observations) {
      if (o.camera == camera_) tracks[o.landmark].push_back(&o);
    }
    for (const auto& seen : tracks) {
      AddTrack(segment, theta.cameras[camera_], motions, seen);
    }
    keyframes_ += static_cast<int>(segment.keyframes.size());
  }

  const std::vector<Row>& rows() const { return rows_; }
  int keyframes() const { return keyframes_; }

 private:
  void AddTrack(const MotionSegment& segment,
                const CameraCalibration& camera,
                const KeyframeMotions& motions,
                const std::vector<const Observation*>& seen) {
    const int time = kCameraIntrinsics + camera.IntrinsicsSize();
    Track track;
    Eigen::MatrixX3d by_position(2 * seen.size(), 3);
    for (const Observation* o : seen) {
      const KeyframeState& x = segment.keyframes[o->keyframe];
      Row row{.keyframe = keyframes_ + o->keyframe, .r_px = {}, .by_delay = {}};
      ReprojectionJacobians J;
      if (!Reproject(x.q_GI,
                     x.p_GI,
                     camera,
                     segment.landmarks[o->landmark].p_G.homogeneous(),
                     o->z_px,
                     &row.r_px,
                     &J,
                     motions.At(o->keyframe, camera_))) {
        continue;
      }
      const double from_middle = o->z_px.y() / camera.height_px - 0.5;
      row.by_delay << J.camera.col(time), from_middle * J.camera.col(time);
      by_position.middleRows<2>(2 * std::ssize(track)) =
          J.landmark.leftCols<3>();
      track.push_back(row);
    }
    if (std::ssize(track) < kMinTrack) return;
    by_position.conservativeResize(2 * std::ssize(track), 3);
    const Track left = WithoutPosition(track, by_position);
    rows_.insert(rows_.end(), left.begin(), left.end());
  }

  const Rig& rig_;
  const Calibration& theta_;
  const int camera_;
  std::vector<Row> rows_;
  int keyframes_ = 0;
};

// Robust least squares. Errors of a keyframe's pose are common to its
// observations: the covariance adds their gradients before it squares them.
Delays FitDelays(const std::vector<Row>& rows, int keyframes) {
  Delays delays;
  for (int round = 0; round < kRounds; ++round) {
    std::vector<double> norms;
    norms.reserve(rows.size());
    for (const Row& row : rows) {
      norms.push_back((row.r_px + row.by_delay * delays.value_s).norm());
    }
    // The median of the norm of two normal errors is 1.1774 of their sigma.
    const double sigma_px = std::max(UpperMedian(norms) / 1.1774, 1e-9);
    Eigen::Matrix2d H = Eigen::Matrix2d::Zero();
    Eigen::Vector2d g = Eigen::Vector2d::Zero();
    std::vector<Eigen::Vector2d> of_keyframe(keyframes,
                                             Eigen::Vector2d::Zero());
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const double u = norms[i] / (kTukey * sigma_px);
      if (u >= 1) continue;
      const double weight = (1 - u * u) * (1 - u * u);
      const Row& row = rows[i];
      const Eigen::Vector2d gradient =
          weight * row.by_delay.transpose() *
          (row.r_px + row.by_delay * delays.value_s);
      H += weight * row.by_delay.transpose() * row.by_delay;
      g += gradient;
      of_keyframe[row.keyframe] += gradient;
    }
    Eigen::Matrix2d scatter = Eigen::Matrix2d::Zero();
    for (const Eigen::Vector2d& gradient : of_keyframe) {
      scatter += gradient * gradient.transpose();
    }
    const Eigen::LDLT<Eigen::Matrix2d> ldlt(H);
    const Eigen::Matrix2d covariance =
        ldlt.solve(ldlt.solve(scatter).transpose().eval());
    delays.value_s -= ldlt.solve(g);
    delays.sigma_s = covariance.diagonal().cwiseSqrt();
    if (!delays.value_s.allFinite() || !delays.sigma_s.allFinite()) return {};
  }
  return delays;
}

std::string Camera(std::size_t j) { return "cam" + std::to_string(j); }

void Report(const CameraCalibration& camera,
            std::size_t j,
            const Delays& delays,
            Diagnosis* diagnosis) {
  const double readout_s = delays.value_s.y();
  diagnosis->findings.push_back(
      {FindingKind::kRollingShutter,
       "the rows of " + Camera(j) +
           " were exposed one after the other, the last one about " +
           Figure(1e3 * readout_s) + " ms after the first (sigma " +
           Figure(1e3 * delays.sigma_s.y()) +
           " ms), but the calibration has a global shutter",
       "create the rig with about line_delay_s = " +
           Figure(readout_s / camera.height_px) + " for " + Camera(j) +
           ": it is estimated from there on",
       readout_s});
}

}  // namespace

void CheckShutter(const Rig& rig,
                  const Calibration& theta,
                  std::span<const MotionSegment> segments,
                  std::span<const double> late_s,
                  Diagnosis* diagnosis) {
  std::size_t seen = 0;
  for (std::size_t j = 0; j < theta.cameras.size(); ++j) {
    const CameraCalibration& camera = theta.cameras[j];
    if (camera.line_delay_s) continue;
    RowCollector collector(rig, theta, static_cast<int>(j));
    for (std::size_t s = 0; s < segments.size(); ++s) {
      if (!Validate(segments[s], theta).empty()) continue;
      collector.Add(segments[s], late_s[s]);
    }
    const std::vector<Row>& rows = collector.rows();
    if (rows.size() < kMinSeen || collector.keyframes() < kMinKeyframes) {
      diagnosis->not_checked.push_back("shutter of " + Camera(j) +
                                       ": too few tracked landmarks");
      continue;
    }
    const Delays delays = FitDelays(rows, collector.keyframes());
    const double sigma_s = delays.sigma_s.y();
    if (kReadoutSigmas * sigma_s > kTold_s) {
      diagnosis->not_checked.push_back("shutter of " + Camera(j) +
                                       ": points hardly move in the image");
      continue;
    }
    seen += rows.size();
    if (std::abs(delays.value_s.y()) >
        std::max(kMinReadout_s, kReadoutSigmas * sigma_s)) {
      Report(camera, j, delays, diagnosis);
    }
  }
  if (seen > 0) {
    diagnosis->checked.push_back("shutter: " + std::to_string(seen) +
                                 " observations");
  }
}

}  // namespace selfcal
