#include "core/calibration/theta_information.h"

#include "core/model/second_imu.h"

namespace selfcal {

std::vector<InertialMatrix> WhitenInertialLinks(
    const Rig& rig,
    const ChainThetas& thetas,
    const CalibrationProblem& problem,
    const std::vector<KeyframeState>& keyframes) {
  std::vector<InertialMatrix> whitening;
  whitening.reserve(problem.inertial_links.size());
  InertialMatrix covariance;
  for (const InertialLink& link : problem.inertial_links) {
    const Calibration& theta = thetas.OfKeyframe(link.before);
    EvaluateInertial(link.samples,
                     StateOfImu(theta, link.imu, keyframes[link.before]),
                     StateOfImu(theta, link.imu, keyframes[link.after]),
                     ImuOf(theta, link.imu),
                     NoiseOfImu(rig, link.imu),
                     rig.gravity_mps2,
                     nullptr,
                     &covariance);
    whitening.push_back(SquareRootInformation(covariance));
  }
  return whitening;
}

InertialNoiseRoot NoiseRootOf(const InertialMatrix& W) {
  const InertialMatrix U =
      W.triangularView<Eigen::Upper>().solve(InertialMatrix::Identity());
  InertialNoiseRoot root;
  for (int i = 0; i < 9; ++i) {
    for (int j = 0; j < 9; ++j) root.motion[i][j] = U(i, j);
    for (int j = 0; j < 6; ++j) root.motion_by_bias[i][j] = U(i, 9 + j);
  }
  for (int i = 0; i < 6; ++i) root.bias[i] = U(9 + i, 9 + i);
  return root;
}

SharedInformation ByOffset(const SharedInformation& at_theta,
                           const Eigen::MatrixXd& theta_by_offset) {
  return {theta_by_offset.transpose() * at_theta.Lambda * theta_by_offset,
          theta_by_offset.transpose() * at_theta.eta,
          at_theta.constant};
}

}  // namespace selfcal
