// Derivatives by the time offset of an IMU, on a motion that is known in closed
// form.
#include "core/factor/imu_delay.h"

#include <gtest/gtest.h>

#include "core/factor/preintegration.h"
#include "core/model/so3.h"
#include "test/core/factor/analytic_motion.h"
#include "test/core/factor/gravity.h"
#include "test/core/factor/random_values.h"

namespace selfcal {
namespace {

constexpr std::int64_t kBegin_ns = 0, kEnd_ns = 100'000'000;

// Moving both ends of an interval earlier adds the motion before its begin and
// takes away that before its end.
TEST(ImuDelay, TheMotionChangesByTheRatesAtBothEnds) {
  RandomValues random(1);
  const Eigen::Vector3d zero = Eigen::Vector3d::Zero();
  for (int trial = 0; trial < 50; ++trial) {
    const ImuCalibration imu =
        trial % 2 == 0 ? random.Imu() : random.CoupledImu();
    const AnalyticMotion motion(random);
    KeyframeState y0, y1;
    y0.t_ns = kBegin_ns;
    y1.t_ns = kEnd_ns;
    y0.b_a = random.Normal3(0.2);
    y0.b_g = random.Normal3(0.02);
    const auto samples = motion.Readings(
        -20'000'000, 120'000'000, 1'000'000, imu, y0.b_a, y0.b_g, kGravity);
    const Preintegration whole =
        Preintegrate(samples, y0.t_ns, y1.t_ns, imu, y0.b_a, y0.b_g, {});
    // Readings of an ideal IMU at the ends.
    const ImuSample a = motion.Reading(kBegin_ns, {}, zero, zero, kGravity);
    const ImuSample b = motion.Reading(kEnd_ns, {}, zero, zero, kGravity);
    Eigen::Matrix<double, 9, 1> expected;
    expected << a.gyro - whole.Delta_R * b.gyro,
        a.gyro.cross(whole.Delta_v) + a.accel - whole.Delta_R * b.accel,
        a.gyro.cross(whole.Delta_p) + whole.dt_s * a.accel - whole.Delta_v;
    const Eigen::Matrix<double, 9, 1> actual =
        MotionByDelay(samples, y0, y1, imu);
    for (int part = 0; part < 3; ++part) {
      EXPECT_LT((actual - expected).segment<3>(3 * part).norm(),
                1e-5 * (1 + expected.segment<3>(3 * part).norm()));
    }
  }
}

TEST(ImuDelay, TheResidualChangesWithTheMotion) {
  RandomValues random(2);
  for (int trial = 0; trial < 50; ++trial) {
    const ImuCalibration imu =
        trial % 2 == 0 ? random.Imu() : random.CoupledImu();
    const auto samples = random.Samples(200, 0.1, 0.3);
    KeyframeState y0 = random.State(kBegin_ns);
    KeyframeState y1 = random.State(kEnd_ns);
    y1.q_GI = y0.q_GI * Exp(random.Normal3(0.3));
    const auto residual = [&](std::int64_t by_ns) {
      KeyframeState a = y0, b = y1;
      a.t_ns -= by_ns;
      b.t_ns -= by_ns;
      return EvaluateInertial(
          samples, a, b, imu, {}, kGravity, nullptr, nullptr);
    };
    constexpr std::int64_t kStep_ns = 1000;
    const InertialResidual expected =
        (residual(kStep_ns) - residual(-kStep_ns)) / (2e-9 * kStep_ns);
    const InertialResidual actual =
        ResidualByDelay(samples, y0, y1, imu, residual(0));
    EXPECT_LT((actual - expected).norm(), 1e-5 * expected.norm());
    EXPECT_EQ((actual.tail<6>().norm()), 0);
  }
}

}  // namespace
}  // namespace selfcal
