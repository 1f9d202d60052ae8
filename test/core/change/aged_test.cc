#include "core/change/aged.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "core/simulation/simulate.h"

namespace selfcal {
namespace {

class AgedTest : public ::testing::Test {
 protected:
  AgedTest() {
    rig_.fixed = {"cam0.principal.*"};
    densities_ =
        WalkDensities(rig_, {{"*", 1e-3}, {"*.focal.*", 0.5}, {"imu.*", 0}});
    covariance_ = Eigen::MatrixXd::Identity(size_, size_) * 1e-4;
    covariance_(0, 1) = covariance_(1, 0) = 5e-5;
  }

  Rig rig_ = HandheldRig("a");
  const Eigen::Index size_ = TangentSize(rig_.factory);
  Eigen::VectorXd densities_;
  Eigen::MatrixXd covariance_;
};

// The walk drawn day by day, many times: the scatter of its end is the increase
// of the covariance.
TEST_F(AgedTest, IsThatOfARandomWalk) {
  constexpr int kDays = 30;
  constexpr int kWalks = 20'000;
  const int focal =
      MatchComponents(TangentComponents(rig_.factory), {"cam0.focal.x"})[0];
  const double density = densities_(focal);
  ASSERT_EQ(density, 0.5);
  std::mt19937_64 random(3);
  std::normal_distribution<double> step(0, density);
  double squares = 0;
  for (int walk = 0; walk < kWalks; ++walk) {
    double end = 0;
    for (int day = 0; day < kDays; ++day) end += step(random);
    squares += end * end;
  }
  const double more =
      AgedCovariance(rig_, densities_, covariance_, kDays)(focal, focal) - 1e-4;
  // The relative standard deviation of the estimate is sqrt(2 / kWalks).
  EXPECT_NEAR(more / (squares / kWalks), 1, 4 * std::sqrt(2.0 / kWalks));
}

TEST_F(AgedTest, FixedAndConstantComponentsStayAsCertain) {
  const Eigen::MatrixXd aged =
      AgedCovariance(rig_, densities_, covariance_, 1000);
  const auto components = TangentComponents(rig_.factory);
  for (const int i :
       MatchComponents(components, {"cam0.principal.*", "imu.*"})) {
    EXPECT_EQ(aged(i, i), covariance_(i, i)) << components[i].name;
  }
  EXPECT_EQ(aged(0, 1), covariance_(0, 1));
}

TEST_F(AgedTest, NothingHappensBeforeItsTime) {
  EXPECT_EQ(AgedCovariance(rig_, densities_, covariance_, 0), covariance_);
  EXPECT_EQ(AgedCovariance(rig_, densities_, covariance_, -5), covariance_);
}

TEST_F(AgedTest, ByDefaultAHundredthOfTheReferenceInADay) {
  const Eigen::VectorXd reference = ReferenceSigmas(rig_);
  const Eigen::MatrixXd aged = AgedCovariance(
      rig_, WalkDensities(rig_, {}), Eigen::MatrixXd::Zero(size_, size_), 1);
  for (const int i : FreeComponents(rig_)) {
    EXPECT_NEAR(std::sqrt(aged(i, i)), 0.01 * reference(i), 1e-12);
  }
}

TEST_F(AgedTest, PatternsAndDensitiesAreChecked) {
  EXPECT_TRUE(Validate(rig_, std::vector<WalkDensity>{{"imu.*", 0}}).empty());
  const auto violations = Validate(
      rig_,
      std::vector<WalkDensity>{
          {"lens.*", 1}, {"imu.*", -1}, {"*", 1e200}, {"*", std::nan("")}});
  ASSERT_EQ(violations.size(), 4u);
  EXPECT_EQ(violations[0].field, "walk_densities[0].pattern");
  EXPECT_EQ(violations[1].field, "walk_densities[1].value");
  EXPECT_EQ(violations[2].field, "walk_densities[2].value");
  EXPECT_EQ(violations[3].field, "walk_densities[3].value");
}

}  // namespace
}  // namespace selfcal
