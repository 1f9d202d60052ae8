#include "test/evaluation/parameter_statistics.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <iterator>

#include "core/simulation/random.h"
#include "core/simulation/simulate.h"

namespace selfcal {
namespace {

// Estimates that are off by a bias and by normal errors of the sigmas.
std::vector<Estimate> Draw(const Calibration& truth,
                           const Eigen::VectorXd& bias,
                           const Eigen::VectorXd& sigma,
                           int count) {
  Random random(1, 77);
  std::vector<Estimate> estimates;
  for (int n = 0; n < count; ++n) {
    Eigen::VectorXd error = bias;
    for (int i = 0; i < error.size(); ++i) {
      error(i) += sigma(i) * random.Normal();
    }
    estimates.push_back({BoxPlus(truth, error), 2 * sigma});
  }
  return estimates;
}

TEST(ParameterStatistics, TellsSpreadErrorAndClaimApart) {
  const Rig rig = HandheldRig("simulated");
  const Calibration truth = rig.factory;
  const Eigen::VectorXd sigma = 0.1 * ReferenceSigmas(rig);
  const Eigen::VectorXd bias = 3 * sigma;
  const ParameterStatistics statistics =
      Summarise(truth, Draw(truth, bias, sigma, 4000));
  const auto near = [](const Eigen::VectorXd& a, const Eigen::VectorXd& b) {
    return (a.cwiseQuotient(b).array() - 1).abs().maxCoeff();
  };
  EXPECT_LT(near(statistics.spread, sigma), 0.05);
  EXPECT_LT(near(statistics.rms_error, std::sqrt(10) * sigma), 0.05);
  EXPECT_LT(near(statistics.rms_sigma, 2 * sigma), 1e-12);
  EXPECT_LT(near(BoxMinus(statistics.average, truth), bias), 0.05);
}

TEST(ParameterStatistics, WritesARowForEachComponentThatIsEstimated) {
  const Rig rig = HandheldRig("simulated");
  const Calibration truth = rig.factory;
  const std::vector<int> free = FreeComponents(rig);
  Eigen::VectorXd sigma = Eigen::VectorXd::Zero(TangentSize(truth));
  sigma(free).setConstant(1e-3);
  const ParameterStatistics statistics =
      Summarise(truth, Draw(truth, 0 * sigma, sigma, 3));
  const std::string csv =
      CompareParameters(truth, {{"a", statistics}, {"b", statistics}}).Csv();
  // A header, and no row for the time offset, which this rig does not estimate.
  ASSERT_LT(free.size(), static_cast<std::size_t>(sigma.size()));
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 1 + std::ssize(free));
  EXPECT_NE(csv.find("a: sd"), std::string::npos);
  EXPECT_NE(csv.find("cam0.focal.x"), std::string::npos);
}

TEST(ParameterStatistics, RatiosLeaveOutWhatIsNotEstimated) {
  EXPECT_EQ(Ratios(Eigen::Vector3d(1, 0, 6), Eigen::Vector3d(2, 0, 3)),
            (std::vector<double>{0.5, 2}));
}

}  // namespace
}  // namespace selfcal
