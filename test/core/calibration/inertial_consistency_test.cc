// Tests that errors match the claimed covariance for sparse keyframes, between
// which biases walk far, and for lost samples.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <cstdio>

#include "test/core/calibration/inertial_devices.h"

namespace selfcal {
namespace {

constexpr int kDevices = 4;

class InertialConsistency : public testing::TestWithParam<InertialCase> {};

TEST_P(InertialConsistency, NeesIsWithinItsBounds) {
  double sum = 0;
  int degrees = 0;
  for (std::uint64_t seed = 1; seed <= kDevices; ++seed) {
    const InertialOutcome outcome = CalibrateInertialDevice(GetParam(), seed);
    ASSERT_EQ(outcome.status, CalibrateStatus::kConverged)
        << "seed " << seed << ": " << outcome.message;
    EXPECT_EQ(outcome.held, 0) << "seed " << seed;
    sum += outcome.error.dot(outcome.covariance.ldlt().solve(outcome.error));
    degrees += static_cast<int>(outcome.error.size());
  }
  std::printf("%s: NEES %.1f of %d\n", GetParam().name.c_str(), sum, degrees);
  // 99.9 % of the chi-square distribution, about.
  const double spread = 3.3 * std::sqrt(2.0 * degrees);
  EXPECT_GT(sum, degrees - spread);
  EXPECT_LT(sum, degrees + spread + 4);
}

INSTANTIATE_TEST_SUITE_P(All,
                         InertialConsistency,
                         testing::ValuesIn(InertialCases()),
                         [](const auto& info) { return info.param.name; });

}  // namespace
}  // namespace selfcal
