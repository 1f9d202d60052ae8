#include "core/information/unobserved.h"

#include <gtest/gtest.h>

#include <Eigen/QR>
#include <algorithm>
#include <random>

namespace selfcal {
namespace {

std::vector<std::string> Names(int size) {
  std::vector<std::string> names;
  for (int i = 0; i < size; ++i) names.push_back("c" + std::to_string(i));
  return names;
}

Eigen::MatrixXd RandomRotation(int size, std::mt19937* random) {
  std::normal_distribution<double> normal;
  Eigen::MatrixXd A(size, size);
  for (auto& x : A.reshaped()) x = normal(*random);
  return Eigen::HouseholderQR<Eigen::MatrixXd>(A).householderQ();
}

TEST(AnalyseObservability, CountsEigenvaluesOfAtLeastOne) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> weak(0, 0.99), strong(1.01, 1e6);
  for (int trial = 0; trial < 200; ++trial) {
    const int size = 1 + trial % 12;
    const int rank = trial % (size + 1);
    Eigen::VectorXd values(size);
    for (int i = 0; i < size; ++i) {
      values(i) = i < rank ? strong(random) : weak(random);
    }
    const Eigen::MatrixXd Q = RandomRotation(size, &random);
    const Observability result = AnalyseObservability(
        Q * values.asDiagonal() * Q.transpose(), Names(size));
    EXPECT_EQ(result.rank, rank);
    ASSERT_EQ(static_cast<int>(result.unobserved.size()), size - rank);
    for (const UnobservedDirection& d : result.unobserved) {
      EXPECT_GE(d.information_ratio, 0);
      EXPECT_LT(d.information_ratio, 1);
    }
  }
}

TEST(AnalyseObservability, DirectionsLieInTheUnobservedSpan) {
  std::mt19937 random(2);
  for (int trial = 0; trial < 100; ++trial) {
    const int size = 6;
    const Eigen::MatrixXd Q = RandomRotation(size, &random);
    Eigen::VectorXd values = Eigen::VectorXd::Constant(size, 1e3);
    values.head(2).setZero();
    const Observability result = AnalyseObservability(
        Q * values.asDiagonal() * Q.transpose(), Names(size));
    ASSERT_EQ(result.unobserved.size(), 2u);
    for (const UnobservedDirection& d : result.unobserved) {
      Eigen::VectorXd v = Eigen::VectorXd::Zero(size);
      double last = 2;
      for (const auto& part : d.parts) {
        v(part.component[1] - '0') = part.weight;
        EXPECT_LE(std::abs(part.weight), last);
        last = std::abs(part.weight);
      }
      EXPECT_GT(d.parts[0].weight, 0);
      EXPECT_GE(v.squaredNorm(), 0.9 - 1e-12);
      // Only the excluded parts are missing.
      const Eigen::VectorXd in_span =
          Q.leftCols(2) * (Q.leftCols(2).transpose() * v);
      EXPECT_GE(in_span.squaredNorm(),
                v.squaredNorm() * v.squaredNorm() - 1e-9);
    }
  }
}

// If several components are equally unknown, each is named individually, not in
// a mixture determined by rounding.
TEST(AnalyseObservability, EquallyUnknownComponentsAreNamedOneByOne) {
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(5, 5);
  information(1, 1) = 50;
  std::mt19937 random(3);
  std::uniform_real_distribution<double> rounding(-1e-12, 1e-12);
  for (int trial = 0; trial < 20; ++trial) {
    Eigen::MatrixXd noisy = information;
    for (auto& x : noisy.reshaped()) x += rounding(random);
    const Observability result =
        AnalyseObservability(0.5 * (noisy + noisy.transpose()), Names(5));
    std::vector<std::string> named;
    for (const UnobservedDirection& d : result.unobserved) {
      ASSERT_EQ(d.parts.size(), 1u);
      EXPECT_NEAR(d.parts[0].weight, 1, 1e-9);
      named.push_back(d.parts[0].component);
    }
    EXPECT_EQ(named, (std::vector<std::string>{"c0", "c2", "c3", "c4"}));
  }
}

TEST(DescribeDirection, GivesTheLargestPartsWithAPositiveFirst) {
  const Eigen::Vector4d v = Eigen::Vector4d(0.1, -0.9, 0.4, 0.05).normalized();
  const UnobservedDirection d = DescribeDirection(v, Names(4), 0.25);
  ASSERT_EQ(d.parts.size(), 2u);
  EXPECT_EQ(d.parts[0].component, "c1");
  EXPECT_EQ(d.parts[0].weight, -v(1));
  EXPECT_EQ(d.parts[1].component, "c2");
  EXPECT_EQ(d.parts[1].weight, -v(2));
  EXPECT_EQ(d.information_ratio, 0.25);
}

}  // namespace
}  // namespace selfcal
