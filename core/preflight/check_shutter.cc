// Compares the rows of images with each other: if they were exposed one after
// the other, the residuals of a point that moves in the image grow with its
// row. The states may follow any row, since a common delay is fitted as well,
// each landmark is free to move, and so is the lens within its prior: an error
// of a wide one differs between rows as well.
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
// of a factory calibration look like up to 6 ms where the lens is held
// constant, and common rolling shutters take 10 ms and more.
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

// The unknowns: a delay of the image, one of the rows, from the middle one in
// units of the image's height, and errors of the intrinsics.
constexpr int kRows = 1;
constexpr int kLens = 2;

// An observation: its residual, and its derivatives by the unknowns; all with
// those by its landmark removed.
struct Row {
  int keyframe;  // over all segments
  Eigen::Vector2d r_px;
  Eigen::Matrix2Xd by_unknown;  // [px/s], and as the lens has it
};

using Track = std::vector<Row>;

struct Readout {
  double value_s = 0;
  double sigma_s = HUGE_VAL;
};

// The rows of a landmark without what its position explains.
Track WithoutPosition(const Track& track, const Eigen::MatrixX3d& by_position) {
  const auto rows = static_cast<Eigen::Index>(2 * track.size());
  const Eigen::Index unknowns = track.front().by_unknown.cols();
  Eigen::MatrixXd all(rows, 1 + unknowns);
  for (std::size_t i = 0; i < track.size(); ++i) {
    const auto at = static_cast<Eigen::Index>(2 * i);
    all.block<2, 1>(at, 0) = track[i].r_px;
    all.block(at, 1, 2, unknowns) = track[i].by_unknown;
  }
  const Eigen::MatrixXd left =
      all - by_position * by_position.colPivHouseholderQr().solve(all);
  Track result = track;
  for (std::size_t i = 0; i < track.size(); ++i) {
    const auto at = static_cast<Eigen::Index>(2 * i);
    result[i].r_px = left.block<2, 1>(at, 0);
    result[i].by_unknown = left.block(at, 1, 2, unknowns);
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
    const int lens = camera.IntrinsicsSize();
    const int time = kCameraIntrinsics + lens;
    Track track;
    Eigen::MatrixX3d by_position(2 * seen.size(), 3);
    for (const Observation* o : seen) {
      const KeyframeState& x = segment.keyframes[o->keyframe];
      Row row{
          .keyframe = keyframes_ + o->keyframe, .r_px = {}, .by_unknown = {}};
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
      row.by_unknown.resize(2, kLens + lens);
      row.by_unknown << J.camera.col(time), from_middle * J.camera.col(time),
          J.camera.middleCols(kCameraIntrinsics, lens);
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

// Robust least squares, with the prior's sigmas of the lens. Errors of a
// keyframe's pose are common to its observations: the covariance adds their
// gradients before it squares them.
Readout FitReadout(const std::vector<Row>& rows,
                   int keyframes,
                   const Eigen::VectorXd& lens_sigmas) {
  const Eigen::Index size = kLens + lens_sigmas.size();
  Eigen::VectorXd x = Eigen::VectorXd::Zero(size);
  Readout readout;
  for (int round = 0; round < kRounds; ++round) {
    std::vector<double> norms;
    norms.reserve(rows.size());
    for (const Row& row : rows) {
      norms.push_back((row.r_px + row.by_unknown * x).norm());
    }
    const double sigma_px =
        std::max(UpperMedian(norms) / kMedianOfRayleigh, 1e-9);
    Eigen::VectorXd prior = Eigen::VectorXd::Zero(size);
    prior.tail(lens_sigmas.size()) =
        (sigma_px * lens_sigmas.cwiseInverse()).cwiseAbs2();
    Eigen::MatrixXd H = prior.asDiagonal();
    Eigen::VectorXd g = prior.cwiseProduct(x);
    Eigen::MatrixXd of_keyframe = Eigen::MatrixXd::Zero(size, keyframes);
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const double u = norms[i] / (kTukey * sigma_px);
      if (u >= 1) continue;
      const double weight = (1 - u * u) * (1 - u * u);
      const Row& row = rows[i];
      const Eigen::VectorXd gradient =
          weight * row.by_unknown.transpose() * (row.r_px + row.by_unknown * x);
      H += weight * row.by_unknown.transpose() * row.by_unknown;
      g += gradient;
      of_keyframe.col(row.keyframe) += gradient;
    }
    Eigen::MatrixXd scatter = of_keyframe * of_keyframe.transpose();
    scatter.diagonal() += sigma_px * sigma_px * prior;
    const Eigen::LDLT<Eigen::MatrixXd> ldlt(H);
    const Eigen::MatrixXd covariance =
        ldlt.solve(ldlt.solve(scatter).transpose().eval());
    x -= ldlt.solve(g);
    readout = {x(kRows), std::sqrt(covariance(kRows, kRows))};
    if (!x.allFinite() || !std::isfinite(readout.sigma_s)) return {};
  }
  return readout;
}

std::string Camera(std::size_t j) { return "cam" + std::to_string(j); }

void Report(const CameraCalibration& camera,
            std::size_t j,
            const Readout& readout,
            Diagnosis* diagnosis) {
  const double readout_s = readout.value_s;
  diagnosis->findings.push_back(
      {FindingKind::kRollingShutter,
       "the rows of " + Camera(j) +
           " were exposed one after the other, the last one about " +
           Figure(1e3 * readout_s) + " ms after the first (sigma " +
           Figure(1e3 * readout.sigma_s) +
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
    const Eigen::VectorXd lens_sigmas = PriorSigmas(rig).segment(
        CameraTangentOffset(theta, static_cast<int>(j)) + kCameraIntrinsics,
        camera.IntrinsicsSize());
    const Readout readout =
        FitReadout(rows, collector.keyframes(), lens_sigmas);
    const double sigma_s = readout.sigma_s;
    if (kReadoutSigmas * sigma_s > kTold_s) {
      diagnosis->not_checked.push_back("shutter of " + Camera(j) +
                                       ": points hardly move in the image");
      continue;
    }
    seen += rows.size();
    if (std::abs(readout.value_s) >
        std::max(kMinReadout_s, kReadoutSigmas * sigma_s)) {
      Report(camera, j, readout, diagnosis);
    }
  }
  if (seen > 0) {
    diagnosis->checked.push_back("shutter: " + std::to_string(seen) +
                                 " observations");
  }
}

}  // namespace selfcal
