#include "core/calibration/subspace.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "core/simulation/simulate.h"

namespace selfcal {
namespace {

// Information of theta's free components, in units of the prior, whose
// eigenvalues are one in 10^-2 .. 10^6 each.
Eigen::MatrixXd RandomInformation(const Rig& rig, std::mt19937* random) {
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> exponent(-2, 6);
  const std::vector<int> free = FreeComponents(rig);
  const auto size = static_cast<Eigen::Index>(free.size());
  Eigen::MatrixXd mixed(size, size);
  for (double& value : mixed.reshaped()) value = normal(*random);
  const Eigen::MatrixXd Q =
      Eigen::HouseholderQR<Eigen::MatrixXd>(mixed).householderQ();
  Eigen::VectorXd values(size);
  for (double& value : values) value = std::pow(10, exponent(*random));
  const int all = TangentSize(rig.factory);
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(all, all);
  information(free, free) = Q * values.asDiagonal() * Q.transpose();
  return information;
}

Eigen::MatrixXd InTangentUnits(const Rig& rig, const Eigen::MatrixXd& Lambda) {
  const Eigen::VectorXd inverse = PriorSigmas(rig).cwiseInverse();
  return inverse.asDiagonal() * Lambda * inverse.asDiagonal();
}

std::vector<std::string> Words(const ThetaSubspace& subspace) {
  std::vector<std::string> words;
  for (const UnobservedDirection& direction : subspace.unobserved) {
    words.emplace_back();
    for (const auto& part : direction.parts) words.back() += part.component;
  }
  return words;
}

TEST(Subspace, HeldDirectionsDoNotDependOnTheScaleOfUnits) {
  std::mt19937 random(1);
  std::uniform_int_distribution<int> exponent(-30, 30);
  for (int i = 0; i < 20; ++i) {
    const Rig rig = HandheldRig("simulated");
    const Eigen::MatrixXd information = RandomInformation(rig, &random);
    const ThetaSubspace expected =
        ObservedSubspace(rig, InTangentUnits(rig, information), 0);
    ASSERT_GT(expected.held.cols(), 0);
    ASSERT_GT(expected.estimated.cols(), 0);
    // Each component in a unit of its own: its sigma is another number.
    Rig scaled = rig;
    const auto components = TangentComponents(rig.factory);
    const Eigen::VectorXd sigmas = PriorSigmas(rig);
    for (std::size_t j = 0; j < components.size(); ++j) {
      scaled.prior_sigmas.push_back(
          {components[j].name,
           std::ldexp(sigmas(static_cast<int>(j)), exponent(random))});
    }
    const ThetaSubspace subspace =
        ObservedSubspace(scaled, InTangentUnits(scaled, information), 0);
    EXPECT_EQ(subspace.estimated.cols(), expected.estimated.cols());
    EXPECT_EQ(Words(subspace), Words(expected));
    const ThetaSubspace held = HoldDirections(
        scaled, InTangentUnits(scaled, information), expected.held);
    EXPECT_EQ(Words(held), Words(expected));
  }
}

TEST(Subspace, HoldsTheGivenDirectionsAndThoseWithLessInformation) {
  std::mt19937 random(2);
  const Rig rig = HandheldRig("simulated");
  const Eigen::MatrixXd Lambda =
      InTangentUnits(rig, RandomInformation(rig, &random));
  const ThetaSubspace observed = ObservedSubspace(rig, Lambda, 0);
  // The best observed one is held as well.
  const Eigen::MatrixXd held = observed.estimated.rightCols<1>();
  const ThetaSubspace subspace = HoldDirections(rig, Lambda, held);
  EXPECT_EQ(subspace.held.cols(), observed.held.cols() + 1);
  EXPECT_EQ(subspace.estimated.cols(), observed.estimated.cols() - 1);
  EXPECT_EQ(subspace.unobserved.size(), subspace.held.cols());
  Eigen::MatrixXd all(held.rows(),
                      subspace.held.cols() + subspace.estimated.cols());
  all << subspace.held, subspace.estimated;
  EXPECT_TRUE((all.transpose() * all).isIdentity(1e-9));
  EXPECT_NEAR((subspace.held.transpose() * held).norm(), 1, 1e-9);
  for (const UnobservedDirection& direction : subspace.unobserved) {
    EXPECT_LT(direction.information_ratio, 1);
  }
}

// Estimated directions are affected by held ones, also beyond the first order:
// over many draws, the errors of all have the claimed covariance.
TEST(Subspace, CovarianceIsThatOfTheErrors) {
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  const Rig rig = HandheldRig("simulated");
  const std::vector<int> free = FreeComponents(rig);
  const Eigen::MatrixXd Lambda =
      InTangentUnits(rig, RandomInformation(rig, &random));
  // Directions that are not eigenvectors of Lambda.
  ThetaSubspace subspace = HoldDirections(
      rig,
      Lambda,
      ObservedSubspace(
          rig, InTangentUnits(rig, RandomInformation(rig, &random)), 4)
          .held);
  subspace.bends =
      PriorSigmas(rig).asDiagonal() * subspace.estimated.leftCols<2>();
  const Eigen::MatrixXd claimed = CovarianceWithHeld(rig, subspace, Lambda);
  const Eigen::MatrixXd basis = TangentBasis(rig, subspace);
  const Eigen::MatrixXd reduced = basis.transpose() * Lambda * basis;
  const Eigen::MatrixXd root =
      Eigen::MatrixXd(Lambda(free, free)).llt().matrixL();
  constexpr int kRuns = 20000;
  double sum = 0;
  for (int i = 0; i < kRuns; ++i) {
    // Errors of held directions, and of the data: eta = Lambda truth + noise.
    Eigen::VectorXd off(subspace.held.cols()), noise(free.size());
    Eigen::Vector2d bent;
    for (double& value : off) value = normal(random);
    for (double& value : bent) value = normal(random);
    for (double& value : noise) value = normal(random);
    Eigen::VectorXd gradient = Eigen::VectorXd::Zero(Lambda.rows());
    gradient(free) = root * noise;
    const Eigen::VectorXd held =
        PriorSigmas(rig).asDiagonal() * subspace.held * off;
    const Eigen::VectorXd error =
        held + subspace.bends * bent +
        basis * reduced.ldlt().solve(basis.transpose() *
                                     (gradient - Lambda * held));
    sum += error(free).dot(Eigen::MatrixXd(claimed(free, free))
                               .ldlt()
                               .solve(Eigen::VectorXd(error(free))));
  }
  const double degrees = static_cast<double>(free.size());
  EXPECT_NEAR(sum / kRuns, degrees, 5 * std::sqrt(2 * degrees / kRuns));
}

}  // namespace
}  // namespace selfcal
