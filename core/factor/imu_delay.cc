#include "core/factor/imu_delay.h"

#include "core/factor/preintegration.h"
#include "core/model/so3.h"

namespace selfcal {
namespace {

constexpr double kTwoSteps_s = 2e-9 * static_cast<double>(kDelayStep_ns);

}  // namespace

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
  Eigen::Matrix<double, 9, 1> by_delay;
  by_delay << Log(more.Delta_R * less.Delta_R.conjugate()),
      more.Delta_v - less.Delta_v, more.Delta_p - less.Delta_p;
  return by_delay / kTwoSteps_s;
}

InertialResidual ResidualByDelay(std::span<const ImuSample> samples,
                                 const KeyframeState& y0,
                                 const KeyframeState& y1,
                                 const ImuCalibration& imu,
                                 const ImuNoise& noise,
                                 double gravity_mps2) {
  const auto moved = [&](std::int64_t by_ns) {
    KeyframeState a = y0, b = y1;
    a.t_ns -= by_ns;
    b.t_ns -= by_ns;
    return EvaluateInertial(
        samples, a, b, imu, noise, gravity_mps2, nullptr, nullptr);
  };
  return (moved(kDelayStep_ns) - moved(-kDelayStep_ns)) / kTwoSteps_s;
}

}  // namespace selfcal
