#include "core/calibration/theta_information.h"

#include <cmath>

#include "core/factor/reprojection.h"
#include "core/information/weak_priors.h"
#include "core/model/so3.h"

namespace selfcal {
namespace {

double Information(double sigma) { return 1 / (sigma * sigma); }

// The gauge is four free directions, so that holding them with any strength
// changes nothing else: one of the size of the other terms, yet so strong that
// the landmarks' priors, which are about fixed places, do not move them.
constexpr double kGaugeSigma_m = 1e-5;
constexpr double kGaugeSigma_rad = 1e-5;

void AddPriors(const CalibrationProblem& problem,
               const std::vector<KeyframeState>& keyframes,
               SparseElimination* system) {
  ChainStateMatrix weak = ChainStateMatrix::Zero();
  weak.diagonal().segment<3>(kStateRotation).array() =
      Information(kTiltPriorSigma_rad);
  weak.diagonal().segment<3>(kStateVelocity).array() =
      Information(kVelocityPriorSigma_mps);
  weak.diagonal().segment<3>(kStateAccelBias).array() =
      Information(kAccelBiasPriorSigma_mps2);
  weak.diagonal().segment<3>(kStateGyroBias).array() =
      Information(kGyroBiasPriorSigma_radps);
  for (const int k : problem.chain_starts) {
    system->AddPrior(k, weak);
  }
  for (const int k : problem.gauge_keyframes) {
    ChainStateMatrix gauge = ChainStateMatrix::Zero();
    const Eigen::Vector3d up_I =
        keyframes[k].q_GI.conjugate() * Eigen::Vector3d::UnitZ();
    gauge.block<3, 3>(kStateRotation, kStateRotation) =
        Information(kGaugeSigma_rad) * up_I * up_I.transpose();
    gauge.diagonal().segment<3>(kStatePosition).array() =
        Information(kGaugeSigma_m);
    system->AddPrior(k, gauge);
  }
}

void AddInertialLinks(const Rig& rig,
                      const ImuCalibration& imu,
                      const CalibrationProblem& problem,
                      const std::vector<KeyframeState>& keyframes,
                      const std::vector<InertialMatrix>& whitening,
                      SparseElimination* system) {
  LinkRows rows;
  InertialJacobians jacobians;
  for (std::size_t i = 0; i < problem.inertial_links.size(); ++i) {
    const InertialLink& link = problem.inertial_links[i];
    rows.residual = whitening[i] * EvaluateInertial(link.samples,
                                                    keyframes[link.before],
                                                    keyframes[link.after],
                                                    imu,
                                                    rig.imu_noise,
                                                    rig.gravity_mps2,
                                                    &jacobians,
                                                    nullptr);
    rows.x0 = whitening[i] * jacobians.x0;
    rows.x1 = whitening[i] * jacobians.x1;
    rows.shared = whitening[i] * jacobians.theta;
    system->AddLink(link.before, link.after, rows);
  }
}

void AddBiasLinks(const CalibrationProblem& problem,
                  const std::vector<KeyframeState>& keyframes,
                  SparseElimination* system) {
  LinkRows rows;
  rows.shared.resize(kChainStateSize, 0);
  for (const BiasLink& link : problem.bias_links) {
    const KeyframeState& a = keyframes[link.before];
    const KeyframeState& b = keyframes[link.after];
    const Eigen::Matrix<double, 6, 1> weight = link.sigmas.cwiseInverse();
    rows.residual.setZero();
    rows.residual.segment<3>(kStateAccelBias) = b.b_a - a.b_a;
    rows.residual.segment<3>(kStateGyroBias) = b.b_g - a.b_g;
    rows.residual.tail<6>().array() *= weight.array();
    rows.x1.setZero();
    rows.x1.diagonal().tail<6>() = weight;
    rows.x0 = -rows.x1;
    system->AddLink(link.before, link.after, rows);
  }
}

// Below it an observation counts as beyond the gate: a landmark must not stand
// on what has all but no weight.
constexpr double kLeastWeight = 1e-6;

std::vector<int> AddLandmarks(const Rig& rig,
                              const Calibration& theta,
                              const CalibrationProblem& problem,
                              const std::vector<KeyframeState>& keyframes,
                              const std::vector<ScreenedLandmark>& landmarks,
                              const RobustLoss* loss,
                              SparseElimination* system) {
  std::vector<int> added;
  std::vector<LandmarkRows> rows;
  ReprojectionJacobians jacobians;
  Eigen::Vector2d r;
  for (std::size_t i = 0; i < landmarks.size(); ++i) {
    const ScreenedLandmark& landmark = landmarks[i];
    const Track& track = problem.tracks[landmark.track];
    const LandmarkAnchor& anchor = landmark.place.anchor;
    const Eigen::Vector4d point_G = landmark.place.Homogeneous();
    Eigen::Matrix<double, 4, 3> by_place;
    by_place << anchor.R_GA.leftCols<2>(), anchor.a_G,
        Eigen::RowVector3d::UnitZ();
    rows.clear();
    for (const int index : landmark.used) {
      const TrackObservation& seen = track.observations[index];
      const KeyframeState& x = keyframes[seen.keyframe];
      if (!Reproject(x.q_GI,
                     x.p_GI,
                     theta.cameras[seen.camera],
                     point_G,
                     seen.z_px,
                     &r,
                     &jacobians)) {
        continue;
      }
      r /= rig.pixel_sigma_px;
      const double weight = loss != nullptr ? loss->Weight(r.squaredNorm()) : 1;
      if (weight < kLeastWeight) {
        continue;
      }
      const double root = std::sqrt(landmark.weight * weight);
      const double scale = root / rig.pixel_sigma_px;
      rows.push_back({seen.keyframe,
                      CameraTangentOffset(theta, seen.camera),
                      root * r,
                      scale * jacobians.pose,
                      scale * jacobians.camera,
                      scale * jacobians.landmark * by_place});
    }
    if (rows.size() >= 2) {
      system->AddLandmark(rows,
                          landmark.weight * Information(kInverseDepthSigma),
                          landmark.place.inverse_depth.z());
      added.push_back(static_cast<int>(i));
    }
  }
  return added;
}

}  // namespace

std::vector<InertialMatrix> WhitenInertialLinks(
    const Rig& rig,
    const ImuCalibration& imu,
    const CalibrationProblem& problem,
    const std::vector<KeyframeState>& keyframes) {
  std::vector<InertialMatrix> whitening;
  whitening.reserve(problem.inertial_links.size());
  InertialMatrix covariance;
  for (const InertialLink& link : problem.inertial_links) {
    EvaluateInertial(link.samples,
                     keyframes[link.before],
                     keyframes[link.after],
                     imu,
                     rig.imu_noise,
                     rig.gravity_mps2,
                     nullptr,
                     &covariance);
    whitening.push_back(SquareRootInformation(covariance));
  }
  return whitening;
}

std::vector<int> LineariseProblem(
    const Rig& rig,
    const Calibration& theta,
    const CalibrationProblem& problem,
    const std::vector<KeyframeState>& keyframes,
    const std::vector<ScreenedLandmark>& landmarks,
    const std::vector<InertialMatrix>& whitening,
    const RobustLoss* loss,
    SparseElimination* system) {
  AddPriors(problem, keyframes, system);
  AddInertialLinks(rig, theta.imu, problem, keyframes, whitening, system);
  AddBiasLinks(problem, keyframes, system);
  return AddLandmarks(rig, theta, problem, keyframes, landmarks, loss, system);
}

SharedInformation ByOffset(const SharedInformation& at_theta,
                           const Eigen::MatrixXd& theta_by_offset) {
  return {theta_by_offset.transpose() * at_theta.Lambda * theta_by_offset,
          theta_by_offset.transpose() * at_theta.eta};
}

Eigen::MatrixXd ThetaByOffset(const Calibration& reference,
                              const Eigen::VectorXd& d) {
  const int size = TangentSize(reference);
  Eigen::MatrixXd derivative = Eigen::MatrixXd::Identity(size, size);
  const auto set_rotation = [&](int offset) {
    derivative.block<3, 3>(offset, offset) =
        RightJacobian(d.segment<3>(offset));
  };
  set_rotation(kAccelRotation);
  for (int j = 0; j < static_cast<int>(reference.cameras.size()); ++j) {
    set_rotation(CameraTangentOffset(reference, j) + kCameraRotation);
  }
  return derivative;
}

}  // namespace selfcal
