// Scores that follow from Lambda alone.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <numbers>
#include <random>

#include "core/information/segment_information.h"
#include "core/simulation/simulate.h"

namespace selfcal {
namespace {

Eigen::MatrixXd RandomInformation(int size, int rank, std::mt19937* random) {
  std::normal_distribution<double> normal;
  Eigen::MatrixXd root(rank, size);
  for (auto& x : root.reshaped()) x = normal(*random);
  return root.transpose() * root;
}

// The size of the tangent with one FOV camera.
constexpr int kSize = 27;

// The rig with estimated time offset, so that nothing is held fixed.
Rig EstimatingAll() {
  Rig rig = HandheldRig("handheld");
  rig.blocks = {{"*.time_offset", true}};
  return rig;
}

// A Lambda that is `information` in units of the rig's prior.
Eigen::MatrixXd InTangentUnits(const Rig& rig,
                               const Eigen::MatrixXd& information) {
  const Eigen::VectorXd unit = PriorSigmas(rig).cwiseInverse();
  return unit.asDiagonal() * information * unit.asDiagonal();
}

TEST(Entropy, OfIndependentComponentsIsTheSumOfTheirs) {
  const Eigen::Vector3d sigma(0.1, 2, 5);
  const Eigen::Vector3d reference(0.2, 1, 10);
  const Eigen::Matrix3d Sigma = sigma.cwiseAbs2().asDiagonal();
  const double one = 0.5 * std::log(2 * std::numbers::pi * std::numbers::e);
  EXPECT_NEAR(Entropy(Sigma, reference),
              3 * one + std::log(0.5) + std::log(2.0) + std::log(0.5),
              1e-12);
}

TEST(Entropy, SigmaRefShiftsEveryCovarianceByTheSameConstant) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> uniform(0.1, 10);
  for (int trial = 0; trial < 100; ++trial) {
    const int k = 1 + trial % 8;
    Eigen::VectorXd a(k), b(k);
    for (int i = 0; i < k; ++i) {
      a(i) = uniform(random);
      b(i) = uniform(random);
    }
    const Eigen::MatrixXd x = RandomInformation(k, k + 2, &random);
    const Eigen::MatrixXd y = RandomInformation(k, k + 2, &random);
    const double shift = (a.array().log() - b.array().log()).sum();
    EXPECT_NEAR(Entropy(x, b) - Entropy(x, a), shift, 1e-9);
    EXPECT_NEAR(Entropy(y, b) - Entropy(y, a), shift, 1e-9);
  }
}

TEST(ScoreGroups, NoInformationGainsExactlyNothing) {
  const Rig rig = HandheldRig("handheld");
  const auto scores = ScoreGroups(rig, Eigen::MatrixXd::Zero(kSize, kSize));
  ASSERT_EQ(scores.size(), 3u);
  for (const GroupScore& score : scores) {
    EXPECT_EQ(score.gain, 0);
    EXPECT_EQ(score.rank, 0);
    ASSERT_EQ(static_cast<int>(score.unobserved.size()), score.size);
    // Ten sigma_ref is the prior: every component by itself.
    EXPECT_NEAR(
        score.entropy,
        score.size * (0.5 * std::log(2 * std::numbers::pi * std::numbers::e) +
                      std::log(10.0)),
        1e-9);
    for (const UnobservedDirection& direction : score.unobserved) {
      EXPECT_EQ(direction.parts.size(), 1u);
    }
  }
}

TEST(ScoreGroups, GainIsTheEntropyOfThePriorMinusThatOfThePosterior) {
  Rig rig = EstimatingAll();
  rig.prior_sigmas = {{"imu.*", 0.02}, {"*.focal.*", 5}};
  std::mt19937 random(2);
  const auto prior = ScoreGroups(rig, Eigen::MatrixXd::Zero(kSize, kSize));
  for (int rank = 1; rank < 40; rank += 3) {
    const Eigen::MatrixXd Lambda =
        InTangentUnits(rig, 10 * RandomInformation(kSize, rank, &random));
    const auto scores = ScoreGroups(rig, Lambda);
    const Eigen::VectorXd information =
        PriorSigmas(rig).cwiseAbs2().cwiseInverse();
    const Eigen::MatrixXd posterior =
        (Lambda + Eigen::MatrixXd(information.asDiagonal())).inverse();
    for (std::size_t q = 0; q < scores.size(); ++q) {
      const std::vector<int> at = GroupComponents(rig, rig.groups[q]);
      EXPECT_NEAR(scores[q].entropy,
                  Entropy(posterior(at, at), ReferenceSigmas(rig)(at)),
                  1e-7);
      EXPECT_GE(scores[q].gain, 0);
      EXPECT_NEAR(scores[q].gain, prior[q].entropy - scores[q].entropy, 1e-9);
      EXPECT_EQ(scores[q].rank + static_cast<int>(scores[q].unobserved.size()),
                scores[q].size);
    }
  }
}

TEST(ScoreGroups, ADirectionIsObservedFromTheInformationOfThePriorOn) {
  Rig rig = HandheldRig("handheld");
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(kSize, kSize);
  information(2, 2) = 1.01;
  information(5, 5) = 0.99;
  const auto scores = ScoreGroups(rig, InTangentUnits(rig, information));
  EXPECT_EQ(scores[0].rank, 1);
  const std::string observed = TangentComponents(rig.factory)[2].name;
  bool weak = false;
  for (const UnobservedDirection& direction : scores[0].unobserved) {
    EXPECT_NE(direction.parts[0].component, observed);
    if (direction.parts[0].component ==
        TangentComponents(rig.factory)[5].name) {
      EXPECT_NEAR(direction.information_ratio, 0.99, 1e-9);
      weak = true;
    }
  }
  EXPECT_TRUE(weak);
}

TEST(ScoreGroups, GroupsMayOverlap) {
  Rig rig = EstimatingAll();
  rig.groups = {{"all", {"*"}}, {"focal", {"*.focal.*"}}};
  std::mt19937 random(3);
  const Eigen::MatrixXd Lambda =
      InTangentUnits(rig, RandomInformation(kSize, 40, &random));
  const auto scores = ScoreGroups(rig, Lambda);
  EXPECT_EQ(scores[0].size, kSize);
  EXPECT_EQ(scores[1].size, 2);
  EXPECT_GE(scores[0].gain, scores[1].gain);
}

TEST(EntropiesWithoutPrior, AreThoseOfTheInverseOfLambda) {
  const Rig rig = EstimatingAll();
  std::mt19937 random(4);
  const Eigen::MatrixXd Lambda =
      InTangentUnits(rig, RandomInformation(kSize, 60, &random));
  const Eigen::MatrixXd Sigma = Lambda.inverse();
  const auto entropies = EntropiesWithoutPrior(rig, Lambda);
  ASSERT_EQ(entropies.size(), 3u);
  for (std::size_t q = 0; q < entropies.size(); ++q) {
    const std::vector<int> at = GroupComponents(rig, rig.groups[q]);
    ASSERT_TRUE(entropies[q].has_value());
    EXPECT_NEAR(
        *entropies[q], Entropy(Sigma(at, at), ReferenceSigmas(rig)(at)), 1e-7);
  }
}

TEST(EntropiesWithoutPrior, OnlyAnUndeterminedGroupHasNone) {
  const Rig rig = EstimatingAll();
  std::mt19937 random(5);
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(kSize, kSize);
  // Extrinsics and camera are determined, the gyroscope is not.
  information.bottomRightCorner(21, 21) = RandomInformation(21, 40, &random);
  const auto entropies =
      EntropiesWithoutPrior(rig, InTangentUnits(rig, information));
  EXPECT_FALSE(entropies[0].has_value());
  EXPECT_TRUE(entropies[1].has_value());
  EXPECT_TRUE(entropies[2].has_value());
  for (const auto& entropy :
       EntropiesWithoutPrior(rig, Eigen::MatrixXd::Zero(kSize, kSize))) {
    EXPECT_FALSE(entropy.has_value());
  }
}

}  // namespace
}  // namespace selfcal
