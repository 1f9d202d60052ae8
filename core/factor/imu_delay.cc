#include "core/factor/imu_delay.h"

#include "core/factor/preintegration.h"
#include "core/model/so3.h"

namespace selfcal {

Eigen::Matrix<double, 9, 1> MotionByDelay(std::span<const ImuSample> samples,
                                          const KeyframeState& y0,
                                          const KeyframeState& y1,
                                          const ImuCalibration& imu) {
  const auto moved = [&](std::int64_t by_ns) {
    return Preintegrate(samples,
                        y0.t_ns - by_ns,
                        y1.t_ns - by_ns,
                        imu,
                        y0.b_a,
                        y0.b_g,
                        {},
                        {.jacobians = false, .covariance = false});
  };
  const Preintegration more = moved(kDelayStep_ns);
  const Preintegration less = moved(-kDelayStep_ns);
  constexpr double kTwoSteps_s = 2e-9 * static_cast<double>(kDelayStep_ns);
  Eigen::Matrix<double, 9, 1> by_delay;
  by_delay << Log(more.Delta_R * less.Delta_R.conjugate()),
      more.Delta_v - less.Delta_v, more.Delta_p - less.Delta_p;
  return by_delay / kTwoSteps_s;
}

// Every change of the motion enters the residual with a negative sign, the
// rotation through Log: Log(Delta_R^-1 q_01) changes by -J_l^-1 Delta_R^-1 psi.
InertialResidual ResidualByDelay(std::span<const ImuSample> samples,
                                 const KeyframeState& y0,
                                 const KeyframeState& y1,
                                 const ImuCalibration& imu,
                                 const InertialResidual& residual) {
  const Eigen::Matrix<double, 9, 1> motion =
      MotionByDelay(samples, y0, y1, imu);
  const Eigen::Vector3d r = residual.head<3>();
  const Eigen::Quaterniond q_01 = y0.q_GI.conjugate() * y1.q_GI;
  const Eigen::Vector3d psi = motion.head<3>();
  const Eigen::Vector3d turn = Exp(r) * (q_01.conjugate() * psi);
  InertialResidual by_delay = InertialResidual::Zero();
  by_delay.head<3>() = -RightJacobianInverse(-r) * turn;
  by_delay.segment<6>(3) = -motion.tail<6>();
  return by_delay;
}

}  // namespace selfcal
