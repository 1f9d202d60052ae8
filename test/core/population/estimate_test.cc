#include "core/population/estimate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "core/population/consistency.h"
#include "test/core/population/random_cohort.h"

namespace selfcal {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

constexpr int kSize = 12;

Cohort Estimate(const std::vector<ThetaInformation>& devices) {
  return EstimateCohort({}, Eigen::VectorXd::Ones(kSize), devices);
}

// Squared error of the prediction of new devices over its expectation, mean
// over several cohorts.
double PredictionError(int devices, double correlation) {
  constexpr int kCohorts = 12;
  constexpr int kNew = 40;
  double sum = 0;
  for (int trial = 0; trial < kCohorts; ++trial) {
    RandomCohort cohort(kSize, correlation, 100 + trial);
    const DevicePrediction predicted =
        PredictDevice(Estimate(cohort.Devices(devices)));
    const Eigen::LLT<Eigen::MatrixXd> root(predicted.covariance);
    for (int i = 0; i < kNew; ++i) {
      const Eigen::VectorXd error = cohort.Draw() - predicted.mean;
      sum += error.dot(root.solve(error)) / kSize;
    }
  }
  return sum / (kCohorts * kNew);
}

// The mean over cohorts varies by about 0.15: the estimates of the devices'
// spread have relative errors of sqrt(2 / devices).
TEST(EstimateCohort, PredictsNewDevicesWithAnHonestCovariance) {
  for (const double correlation : {0.0, 0.8}) {
    for (const int devices : {10, 50}) {
      const double error = PredictionError(devices, correlation);
      EXPECT_LT(error, devices == 10 ? 1.6 : 1.25)
          << devices << " devices, correlation " << correlation;
      EXPECT_GT(error, devices == 10 ? 0.3 : 0.75)
          << devices << " devices, correlation " << correlation;
    }
  }
}

TEST(EstimateCohort, FindsMeanAndSpread) {
  RandomCohort truth(kSize, 0.5, 7);
  const Cohort cohort = Estimate(truth.Devices(400));
  const Eigen::VectorXd error = cohort.mu - truth.mu;
  EXPECT_LT(error.dot(cohort.mu_covariance.llt().solve(error)),
            32.9);  // 99.9 %
  for (int i = 0; i < kSize; ++i) {
    EXPECT_NEAR(std::sqrt(cohort.S(i, i) / truth.S(i, i)), 1, 0.15) << i;
  }
  EXPECT_GT(cohort.correlation, 0.7);
}

TEST(EstimateCohort, KeepsTheScaleOfWhatNoDeviceObserves) {
  RandomCohort truth(kSize, 0, 3);
  std::vector<ThetaInformation> devices = truth.Devices(30);
  for (ThetaInformation& device : devices) {
    device.Lambda.row(4).setZero();
    device.Lambda.col(4).setZero();
    device.eta(4) = 0;
  }
  const Cohort cohort = Estimate(devices);
  EXPECT_DOUBLE_EQ(cohort.S(4, 4), 1);
  EXPECT_DOUBLE_EQ(cohort.degrees(4), 0);
  EXPECT_DOUBLE_EQ(cohort.mu(4), 0);
  EXPECT_DOUBLE_EQ(cohort.mu_covariance(4, 4), 1);
  EXPECT_GT(cohort.degrees(5), 15);
}

TEST(EstimateCohort, OfFewDevicesKnowsTheScaleAlone) {
  RandomCohort truth(kSize, 0, 3);
  const Cohort cohort = Estimate(truth.Devices(kLeastCohort - 1));
  EXPECT_EQ(cohort.S, Eigen::MatrixXd::Identity(kSize, kSize));
  EXPECT_EQ(cohort.mu, Eigen::VectorXd::Zero(kSize));
  EXPECT_EQ(cohort.degrees, Eigen::VectorXd::Zero(kSize));
}

TEST(EstimateCohort, LeavesOutBrokenDevicesAndNoOthers) {
  RandomCohort truth(kSize, 0.3, 11);
  std::vector<ThetaInformation> devices = truth.Devices(40);
  // One component of one device is 8 sigma off, and two devices are of another
  // kind.
  Eigen::VectorXd knocked = truth.Draw();
  knocked(2) += 8 * std::sqrt(truth.S(2, 2));
  devices[5] = truth.Measure(knocked, 4 * kSize, 0.02);
  for (const int i : {17, 30}) {
    const Eigen::VectorXd other =
        truth.Draw() + 5 * truth.S.diagonal().cwiseSqrt();
    devices[i] = truth.Measure(other, 4 * kSize, 0.02);
  }
  const Cohort cohort = Estimate(devices);
  EXPECT_THAT(cohort.outliers, ElementsAre(5, 17, 30));
}

TEST(EstimateCohort, LeavesOutDevicesOfItsOwnAtTheStatedRate) {
  constexpr int kCohorts = 100;
  int with_outliers = 0;
  for (int trial = 0; trial < kCohorts; ++trial) {
    RandomCohort truth(kSize, 0.3, 500 + trial);
    if (!Estimate(truth.Devices(20)).outliers.empty()) ++with_outliers;
  }
  EXPECT_LE(with_outliers, 5);  // 1 %: more than 5 of 100 is 0.05 % likely
}

TEST(EstimateCohort, KeepsMostOfACohortThatAgreesOnNothing) {
  RandomCohort truth(kSize, 0, 1);
  std::vector<ThetaInformation> devices;
  for (int i = 0; i < kLeastCohort; ++i) {
    devices.push_back(truth.Measure(3 * truth.Normals(kSize), 4 * kSize, 1e-3));
  }
  const Cohort cohort = Estimate(devices);
  EXPECT_GE(cohort.devices.size(), 3u);
}

TEST(EstimateCohort, EndsSoonIfItIsCancelled) {
  RandomCohort truth(kSize, 0.5, 3);
  const auto devices = truth.Devices(20);
  int asked = 0;
  CohortOptions options;
  options.cancelled = [&] { return ++asked < 0; };
  const Eigen::VectorXd scale = Eigen::VectorXd::Ones(kSize);
  EstimateCohort({}, scale, devices, options);
  const int steps = asked;
  asked = 0;
  options.cancelled = [&] { return ++asked > 3; };
  EstimateCohort({}, scale, devices, options);
  EXPECT_GT(asked, 3);
  EXPECT_LT(3 * asked, steps);
}

TEST(CompareWithCohort, FindsTheComponentThatDiffers) {
  RandomCohort truth(kSize, 0.3, 21);
  const Cohort cohort = Estimate(truth.Devices(50));
  Eigen::VectorXd knocked = truth.Draw();
  knocked(7) += 10 * std::sqrt(truth.S(7, 7));
  const CohortConsistency found =
      CompareWithCohort(cohort, truth.Measure(knocked, 8 * kSize, 0.005));
  EXPECT_LT(found.probability, 1e-6);
  ASSERT_FALSE(found.components.empty());
  EXPECT_EQ(found.components.front().component, 7);
  EXPECT_NEAR(found.components.front().difference,
              10 * std::sqrt(truth.S(7, 7)),
              4 * std::sqrt(truth.S(7, 7)));
}

TEST(CompareWithCohort, HasNoDoubtsWithoutData) {
  RandomCohort truth(kSize, 0.3, 21);
  const Cohort cohort = Estimate(truth.Devices(20));
  const CohortConsistency found = CompareWithCohort(
      cohort,
      {Eigen::MatrixXd::Zero(kSize, kSize), Eigen::VectorXd::Zero(kSize)});
  EXPECT_EQ(found.probability, 1);
  EXPECT_THAT(found.components, IsEmpty());
}

// Each direction is known three times less than the cohort knows it.
TEST(CompareWithCohort, ManyDirectionsThatAreKnownALittleCountTogether) {
  RandomCohort truth(kSize, 0.3, 22);
  const Cohort cohort = Estimate(truth.Devices(50));
  const DevicePrediction prediction = PredictDevice(cohort);
  const Eigen::MatrixXd Lambda = prediction.covariance.inverse() / 3;
  const auto probability = [&](double spreads, double sign) {
    const Eigen::VectorXd offset =
        sign * spreads * truth.S.diagonal().cwiseSqrt();
    return CompareWithCohort(cohort,
                             {Lambda, Lambda * (prediction.mean + offset)})
        .probability;
  };
  EXPECT_GT(probability(1, 1), 0.05);
  EXPECT_LT(probability(5, 1), 0.01);
  EXPECT_LT(probability(5, -1), 0.01);
}

// The number of devices, of 400 of ten cohorts, that are unlikely at 5 % in
// their own cohort, by data with this noise.
int Unlikely(double noise) {
  int unlikely = 0;
  constexpr int kNew = 40;
  constexpr int kCohorts = 10;
  for (int trial = 0; trial < kCohorts; ++trial) {
    RandomCohort truth(kSize, 0.3, 900 + trial);
    const Cohort cohort = Estimate(truth.Devices(50));
    for (int i = 0; i < kNew; ++i) {
      const CohortConsistency found = CompareWithCohort(
          cohort, truth.Measure(truth.Draw(), 4 * kSize, noise));
      if (found.probability < 0.05) ++unlikely;
    }
  }
  return unlikely;
}

TEST(CompareWithCohort, IsCalibratedForDevicesOfTheCohort) {
  // 5 % of 400 are 20; the cohorts' own errors add to chance.
  EXPECT_LE(Unlikely(0.05), 40);
}

TEST(CompareWithCohort, IsCalibratedWhereTheDataKnowsLittle) {
  for (const double noise : {0.5, 2.0}) EXPECT_LE(Unlikely(noise), 40) << noise;
}

}  // namespace
}  // namespace selfcal
