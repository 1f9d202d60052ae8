#include "core/information/linearisation.h"

#include <cmath>
#include <span>

#include "core/factor/inertial.h"
#include "core/factor/reprojection.h"
#include "core/information/weak_priors.h"

namespace selfcal {
namespace {

constexpr int kKinds = kStateTangentSize / 3;

// The gauge is a prior as well: the rest of the problem does not depend on it,
// so any proper one gives what removing its four directions does. This size
// keeps the numbers near those of the inertial factors.
constexpr double kGaugeSigma_m = 1e-3;
constexpr double kGaugeSigma_rad = 1e-3;

double Information(double sigma) { return 1 / (sigma * sigma); }

// Weak prior on velocity and biases.
ChainStateMatrix MotionPrior() {
  ChainStateVector prior = ChainStateVector::Zero();
  prior.segment<3>(kStateVelocity)
      .setConstant(Information(kVelocityPriorSigma_mps));
  prior.segment<3>(kStateAccelBias)
      .setConstant(Information(kAccelBiasPriorSigma_mps2));
  prior.segment<3>(kStateGyroBias)
      .setConstant(Information(kGyroBiasPriorSigma_radps));
  return prior.asDiagonal();
}

// Holds position and rotation about gravity; the tilt weakly.
ChainStateMatrix GaugePrior(const KeyframeState& x) {
  ChainStateMatrix prior = ChainStateMatrix::Zero();
  const Eigen::Matrix3d R_IG = x.q_GI.toRotationMatrix().transpose();
  const double tilt = Information(kTiltPriorSigma_rad);
  const Eigen::Vector3d rotation_G(tilt, tilt, Information(kGaugeSigma_rad));
  prior.block<3, 3>(kStateRotation, kStateRotation) =
      R_IG * rotation_G.asDiagonal() * R_IG.transpose();
  prior.diagonal()
      .segment<3>(kStatePosition)
      .setConstant(Information(kGaugeSigma_m));
  return prior;
}

// One walk through a segment.
class Linearisation {
 public:
  Linearisation(const Rig& rig,
                const Calibration& theta0,
                const MotionSegment& segment,
                const InlierSelection& selection,
                const Eigen::VectorXd& theta_scale,
                int gauge_keyframe)
      : rig_(rig),
        theta0_(theta0),
        segment_(segment),
        selection_(selection),
        scale_(theta_scale),
        gauge_(gauge_keyframe),
        tracks_(segment.keyframes.size()) {
    for (int j = 0; j < static_cast<int>(theta0.cameras.size()); ++j) {
      camera_offsets_.push_back(CameraTangentOffset(theta0, j));
    }
    FindTracks();
  }

  LinearisedSegment Run() {
    const int keyframes = static_cast<int>(segment_.keyframes.size());
    elimination_.Start(static_cast<int>(scale_.size()));
    for (int k = 0; k < keyframes; ++k) {
      if (k == 0) elimination_.AddPrior(MotionPrior());
      if (k == gauge_) {
        elimination_.AddPrior(GaugePrior(segment_.keyframes[k]));
      }
      for (const std::span<const int> track : tracks_[k]) AddTrack(track);
      if (k + 1 < keyframes) elimination_.Advance(Link(k));
    }
    LinearisedSegment result;
    result.theta = elimination_.Finish();
    for (const double sum : inertial_squares_) {
      result.inertial_rms.push_back(std::sqrt(sum / (3.0 * (keyframes - 1))));
    }
    return result;
  }

 private:
  // Inliers are sorted by landmark, then keyframe: each run of a landmark is
  // filed under the first keyframe that sees it.
  void FindTracks() {
    const std::span<const int> inliers = selection_.inliers;
    for (std::size_t begin = 0; begin < inliers.size();) {
      const Observation& first = segment_.observations[inliers[begin]];
      std::size_t end = begin + 1;
      while (end < inliers.size() &&
             segment_.observations[inliers[end]].landmark == first.landmark) {
        ++end;
      }
      tracks_[first.keyframe].push_back(inliers.subspan(begin, end - begin));
      begin = end;
    }
  }

  void AddTrack(std::span<const int> track) {
    rows_.clear();
    for (const int index : track) AddRows(segment_.observations[index]);
    if (rows_.empty()) return;
    elimination_.AddLandmark(
        rows_, 1 / (kLandmarkPriorSigma_m * kLandmarkPriorSigma_m));
  }

  void AddRows(const Observation& observation) {
    const KeyframeState& x = segment_.keyframes[observation.keyframe];
    const Eigen::Vector3d& p_G = selection_.landmarks[observation.landmark];
    Eigen::Vector2d r;
    ReprojectionJacobians J;
    if (!Reproject(x.q_GI,
                   x.p_GI,
                   theta0_.cameras[observation.camera],
                   p_G.homogeneous(),
                   observation.z_px,
                   &r,
                   &J)) {
      return;
    }
    const double weight = 1 / rig_.pixel_sigma_px;
    LandmarkRows& rows = rows_.emplace_back();
    rows.keyframe = observation.keyframe;
    rows.shared_offset = camera_offsets_[observation.camera];
    rows.residual = weight * r;
    rows.pose = weight * J.pose;
    rows.landmark = weight * J.landmark.leftCols<3>();
    rows.shared = weight * J.camera;
    for (int c = 0; c < rows.shared.cols(); ++c) {
      rows.shared.col(c) *= scale_(rows.shared_offset + c);
    }
  }

  LinkRows Link(int k) {
    const KeyframeState& x0 = segment_.keyframes[k];
    const KeyframeState& x1 = segment_.keyframes[k + 1];
    InertialJacobians J;
    InertialMatrix covariance;
    const InertialResidual r = EvaluateInertial(segment_.imu,
                                                x0,
                                                x1,
                                                theta0_.imu,
                                                rig_.imu_noise,
                                                rig_.gravity_mps2,
                                                &J,
                                                &covariance);
    const InertialMatrix W = SquareRootInformation(covariance);
    LinkRows rows;
    rows.residual = W * r;
    rows.x0 = W * J.x0;
    rows.x1 = W * J.x1;
    rows.shared = W * J.theta * scale_.head<kImuTangentSize>().asDiagonal();
    for (int kind = 0; kind < kKinds; ++kind) {
      inertial_squares_[kind] +=
          rows.residual.segment<3>(3 * kind).squaredNorm();
    }
    return rows;
  }

  const Rig& rig_;
  const Calibration& theta0_;
  const MotionSegment& segment_;
  const InlierSelection& selection_;
  const Eigen::VectorXd& scale_;
  const int gauge_;
  std::vector<std::vector<std::span<const int>>> tracks_;
  std::vector<int> camera_offsets_;
  std::vector<LandmarkRows> rows_;
  ChainElimination elimination_;
  double inertial_squares_[kKinds] = {};
};

}  // namespace

LinearisedSegment EliminateSegment(const Rig& rig,
                                   const Calibration& theta0,
                                   const MotionSegment& segment,
                                   const InlierSelection& selection,
                                   const Eigen::VectorXd& theta_scale,
                                   int gauge_keyframe) {
  return Linearisation(
             rig, theta0, segment, selection, theta_scale, gauge_keyframe)
      .Run();
}

}  // namespace selfcal
