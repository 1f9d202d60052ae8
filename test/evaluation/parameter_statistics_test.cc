#include "test/evaluation/parameter_statistics.h"

#include <gtest/gtest.h>

#include <cmath>

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

TEST(ParameterStatistics, WritesARowForEachComponent) {
  const Calibration truth = HandheldRig("simulated").factory;
  const Eigen::VectorXd sigma = Eigen::VectorXd::Constant(26, 1e-3);
  const ParameterStatistics statistics =
      Summarise(truth, Draw(truth, 0 * sigma, sigma, 3));
  const std::string csv =
      CompareParameters(truth, {{"a", statistics}, {"b", statistics}}).Csv();
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 27);
  EXPECT_NE(csv.find("a: sd"), std::string::npos);
  EXPECT_NE(csv.find("cam0.focal.x"), std::string::npos);
}

}  // namespace
}  // namespace selfcal
