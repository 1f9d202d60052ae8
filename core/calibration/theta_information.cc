#include "core/calibration/theta_information.h"

#include "core/model/so3.h"

namespace selfcal {
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

SharedInformation ByOffset(const SharedInformation& at_theta,
                           const Eigen::MatrixXd& theta_by_offset) {
  return {theta_by_offset.transpose() * at_theta.Lambda * theta_by_offset,
          theta_by_offset.transpose() * at_theta.eta,
          at_theta.constant};
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
