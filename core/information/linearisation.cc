#include "core/information/linearisation.h"

#include <cmath>
#include <span>

#include "core/factor/inertial.h"
#include "core/factor/reprojection.h"
#include "core/information/weak_priors.h"

namespace selfcal {
namespace {

constexpr int kKinds = kStateTangentSize / 3;

using PoseBasis = Eigen::Matrix<double, kChainPoseSize, kChainPoseSize>;

// Weak prior information of a keyframe's state.
ChainStateVector StatePrior() {
  const auto information = [](double sigma) {
    return Eigen::Vector3d::Constant(1 / (sigma * sigma));
  };
  ChainStateVector prior = ChainStateVector::Zero();
  prior.segment<3>(kStateVelocity) = information(kVelocityPriorSigma_mps);
  prior.segment<3>(kStateAccelBias) = information(kAccelBiasPriorSigma_mps2);
  prior.segment<3>(kStateGyroBias) = information(kGyroBiasPriorSigma_radps);
  return prior;
}

// The keyframe with the gauge has two unknowns of its pose left: the first two,
// roll and pitch about the horizontal axes of G. Its other four are without any
// rows and get a unit prior, which eliminates nothing.
ChainStateVector GaugePrior() {
  ChainStateVector prior = StatePrior();
  prior.head<2>().setConstant(1 / (kTiltPriorSigma_rad * kTiltPriorSigma_rad));
  prior.segment<4>(2).setOnes();
  return prior;
}

PoseBasis GaugeBasis(const KeyframeState& x) {
  PoseBasis basis = PoseBasis::Zero();
  basis.topLeftCorner<3, 2>() =
      x.q_GI.toRotationMatrix().transpose().leftCols<2>();
  return basis;
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
        gauge_basis_(GaugeBasis(segment.keyframes[gauge_keyframe])),
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
      elimination_.AddPrior(k == gauge_ ? GaugePrior() : StatePrior());
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
    if (observation.keyframe == gauge_) {
      rows.pose = (rows.pose * gauge_basis_).eval();
    }
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
    if (k == gauge_) ApplyGauge(&rows.x0);
    if (k + 1 == gauge_) ApplyGauge(&rows.x1);
    rows.shared = W * J.theta * scale_.head<kImuTangentSize>().asDiagonal();
    for (int kind = 0; kind < kKinds; ++kind) {
      inertial_squares_[kind] +=
          rows.residual.segment<3>(3 * kind).squaredNorm();
    }
    return rows;
  }

  void ApplyGauge(ChainStateMatrix* J) const {
    J->leftCols<kChainPoseSize>() =
        (J->leftCols<kChainPoseSize>() * gauge_basis_).eval();
  }

  const Rig& rig_;
  const Calibration& theta0_;
  const MotionSegment& segment_;
  const InlierSelection& selection_;
  const Eigen::VectorXd& scale_;
  const int gauge_;
  const PoseBasis gauge_basis_;
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
