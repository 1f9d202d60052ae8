// Devices whose theta differs from the factory's by more or less than the
// tolerances say, calibrated linearly.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "core/information/fusion.h"
#include "core/population/consistency.h"
#include "core/simulation/simulate.h"
#include "test/core/population/run_estimate.h"

namespace selfcal {
namespace {

// Small enough that the curvature of rotations does not matter.
constexpr double kSmall = 1e-3;

class PriorAgreementTest : public testing::Test {
 protected:
  PriorAgreementTest() : rig_(HandheldRig("device")) {
    const Eigen::VectorXd sigmas = PriorSigmas(rig_);
    const auto components = TangentComponents(rig_.factory);
    rig_.prior_sigmas.clear();
    for (std::size_t k = 0; k < components.size(); ++k) {
      const double sigma = kSmall * sigmas(static_cast<Eigen::Index>(k));
      rig_.prior_sigmas.push_back({components[k].name, sigma});
    }
  }

  Eigen::VectorXd Normals(Eigen::Index count) {
    return Eigen::VectorXd::NullaryExpr(
        count, [&] { return std::normal_distribution()(random_); });
  }

  struct Trial {
    PriorAgreement agreement;
    double nees = 0;  // per component
  };

  // Calibrates a device that is `spread` times as far from the factory's
  // calibration as the tolerances say, with `rows` measurements that are
  // `precision` times as precise as the prior.
  Trial Calibrate(double spread, int rows, double precision) {
    const Eigen::VectorXd sigmas = PriorSigmas(rig_);
    const auto size = sigmas.size();
    const std::vector<int> free = FreeComponents(rig_);
    Eigen::VectorXd offset = Eigen::VectorXd::Zero(size);
    for (const int k : free) offset(k) = spread * sigmas(k) * Normals(1)(0);
    Eigen::MatrixXd J(rows, size);
    for (int i = 0; i < rows; ++i) {
      J.row(i) = precision * Normals(size).cwiseQuotient(sigmas).transpose() /
                 std::sqrt(static_cast<double>(size));
    }
    SegmentInformation data;
    data.theta0 = rig_.factory;
    data.Lambda = J.transpose() * J;
    data.eta = J.transpose() * (J * offset + Normals(rows));
    const RunEstimate run = EstimateAsARun(rig_, data);
    const Eigen::VectorXd error =
        BoxMinus(run.theta, BoxPlus(rig_.factory, offset));
    // In units of the prior: those of the components differ by orders.
    const Eigen::VectorXd scale = sigmas(free).cwiseInverse();
    const Eigen::MatrixXd covariance =
        scale.asDiagonal() * run.covariance(free, free) * scale.asDiagonal();
    const Eigen::VectorXd e = scale.cwiseProduct(error(free));
    return {CompareWithPrior(rig_, run.theta, run.covariance),
            e.dot(covariance.llt().solve(e)) / static_cast<double>(e.size())};
  }

  Rig rig_;
  std::mt19937 random_{5};
};

TEST_F(PriorAgreementTest, IsCalibratedWhereThePriorHolds) {
  int unlikely = 0;
  constexpr int kTrials = 400;
  for (int i = 0; i < kTrials; ++i) {
    const Trial trial = Calibrate(1, 20, 30);
    EXPECT_GT(trial.agreement.degrees, 15);
    unlikely += trial.agreement.probability < 0.05;
  }
  // 5 %, with a standard deviation of 1.1 %.
  EXPECT_NEAR(unlikely / double{kTrials}, 0.05, 0.035);
}

// Nothing but the prior is known of every second direction.
TEST_F(PriorAgreementTest, TellsHowWrongTheEstimateIs) {
  for (const double spread : {2.0, 4.0}) {
    double nees = 0;
    double predicted = 0;
    constexpr int kTrials = 200;
    for (int i = 0; i < kTrials; ++i) {
      const Trial trial = Calibrate(spread, 13, 30);
      EXPECT_LT(trial.agreement.probability, spread > 3 ? 1e-4 : 1);
      nees += trial.nees / kTrials;
      predicted +=
          trial.agreement.error_ratio * trial.agreement.error_ratio / kTrials;
    }
    EXPECT_NEAR(predicted / nees, 1, 0.15) << spread;
    EXPECT_GT(nees, 0.4 * spread * spread);
  }
}

TEST_F(PriorAgreementTest, AWrongPriorDoesNotMatterWhereTheDataDecides) {
  const Trial trial = Calibrate(8, 500, 1000);
  EXPECT_LT(trial.agreement.probability, 1e-12);
  EXPECT_NEAR(trial.agreement.prior_error_ratio, 8, 3);
  EXPECT_LT(trial.agreement.error_ratio, 1.01);
}

TEST_F(PriorAgreementTest, TolerancesThatAreTooWideDoNoHarm) {
  const Trial trial = Calibrate(0.1, 13, 30);
  EXPECT_GT(trial.agreement.probability, 0.99);
  EXPECT_EQ(trial.agreement.error_ratio, 1);
}

TEST_F(PriorAgreementTest, HasNoDoubtsWithoutData) {
  const Trial trial = Calibrate(5, 1, 0.001);
  EXPECT_EQ(trial.agreement.degrees, 0);
  EXPECT_EQ(trial.agreement.probability, 1);
  EXPECT_EQ(trial.agreement.error_ratio, 1);
}

TEST_F(PriorAgreementTest, FixedComponentsAreNotCompared) {
  const double before = Calibrate(1, 500, 1000).agreement.degrees;
  rig_.fixed = {"cam0.principal.*"};
  EXPECT_EQ(Calibrate(1, 500, 1000).agreement.degrees, before - 2);
}

// The mean of another cohort, 4 spreads away, of devices like the factory's.
TEST_F(PriorAgreementTest, AWrongPriorMeanIsFound) {
  EXPECT_EQ(Calibrate(0.5, 13, 30).agreement.error_ratio, 1);
  const Eigen::VectorXd sigmas = PriorSigmas(rig_);
  Eigen::VectorXd offset = Eigen::VectorXd::Zero(sigmas.size());
  for (const int k : FreeComponents(rig_)) offset(k) = 4 * sigmas(k);
  rig_.prior_mean = BoxPlus(rig_.factory, offset);
  const PriorAgreement agreement = Calibrate(0.5, 13, 30).agreement;
  EXPECT_LT(agreement.probability, 1e-4);
  EXPECT_NEAR(agreement.prior_error_ratio, 4, 2);
  EXPECT_GT(agreement.error_ratio, 1.5);
}

}  // namespace
}  // namespace selfcal
