#include <gtest/gtest.h>

#include <Eigen/QR>
#include <cmath>
#include <functional>

#include "core/factor/ceres_factors.h"
#include "core/model/so3.h"
#include "test/core/factor/random_values.h"
#include "test/core/numeric_jacobian.h"

namespace selfcal {
namespace {

using Eigen::MatrixXd;
using Eigen::Quaterniond;
using Eigen::Vector3d;
using Eigen::Vector4d;
using Eigen::VectorXd;
using RowMajorXd =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

constexpr int kTrials = 1000;

VectorXd Plus(const ceres::Manifold& m, const VectorXd& x, const VectorXd& d) {
  VectorXd y(m.AmbientSize());
  EXPECT_TRUE(m.Plus(x.data(), d.data(), y.data()));
  return y;
}

VectorXd Minus(const ceres::Manifold& m, const VectorXd& y, const VectorXd& x) {
  VectorXd d(m.TangentSize());
  EXPECT_TRUE(m.Minus(y.data(), x.data(), d.data()));
  return d;
}

MatrixXd PlusJacobian(const ceres::Manifold& m, const VectorXd& x) {
  RowMajorXd J(m.AmbientSize(), m.TangentSize());
  EXPECT_TRUE(m.PlusJacobian(x.data(), J.data()));
  return J;
}

MatrixXd MinusJacobian(const ceres::Manifold& m, const VectorXd& x) {
  RowMajorXd J(m.TangentSize(), m.AmbientSize());
  EXPECT_TRUE(m.MinusJacobian(x.data(), J.data()));
  return J;
}

// The identities of ceres/manifold.h.
void ExpectManifold(const ceres::Manifold& m,
                    RandomValues& random,
                    const std::function<VectorXd()>& point,
                    double max_step) {
  const int n = m.TangentSize();
  for (int trial = 0; trial < kTrials; ++trial) {
    const VectorXd x = point();
    const VectorXd zero = VectorXd::Zero(n);
    const VectorXd d =
        random.LogUniform(1e-9, max_step) * random.NormalVector(n).normalized();
    const VectorXd y = Plus(m, x, d);
    EXPECT_LT((Plus(m, x, zero) - x).norm(), 1e-15 * (1 + x.norm()));
    EXPECT_LT(Minus(m, x, x).norm(), 1e-15);
    EXPECT_LT((Minus(m, y, x) - d).norm(), 1e-13 * (1 + x.norm()));
    EXPECT_LT((Plus(m, x, Minus(m, y, x)) - y).norm(), 1e-13 * (1 + x.norm()));

    const MatrixXd J = PlusJacobian(m, x);
    EXPECT_LT(RowwiseDifference(
                  J,
                  NumericJacobian(
                      [&](const VectorXd& delta) { return Plus(m, x, delta); },
                      n,
                      1e-3)),
              1e-10);
    const MatrixXd J_minus = MinusJacobian(m, x);
    EXPECT_LT((J_minus * J - MatrixXd::Identity(n, n)).norm(), 1e-13);
    EXPECT_LT(RowwiseDifference(J_minus,
                                NumericJacobian(
                                    [&](const VectorXd& delta) {
                                      return Minus(m, x + delta, x);
                                    },
                                    m.AmbientSize(),
                                    1e-3)),
              1e-10);
    if (testing::Test::HasFailure()) FAIL() << "trial " << trial;
  }
}

VectorXd Coefficients(const Quaterniond& q) { return q.coeffs(); }

Quaterniond ToRotation(const VectorXd& x) { return Quaterniond(Vector4d(x)); }

TEST(RotationManifold, KeepsTheIdentitiesOfAManifold) {
  RandomValues random(1);
  ExpectManifold(
      *MakeRotationManifold(),
      random,
      [&] { return Coefficients(random.Rotation()); },
      M_PI - 1e-3);
}

TEST(RotationManifold, PerturbsOnTheRight) {
  RandomValues random(2);
  const auto manifold = MakeRotationManifold();
  for (int trial = 0; trial < kTrials; ++trial) {
    const Quaterniond q = random.Rotation();
    const Vector3d d = random.Normal3(1);
    const VectorXd y = Plus(*manifold, q.coeffs(), d);
    EXPECT_LT((y - (q * Exp(d)).coeffs()).norm(), 1e-14);
    EXPECT_NEAR(y.norm(), 1, 1e-15);
  }
}

TEST(RotationManifold, TakesQAndMinusQForTheSameRotation) {
  RandomValues random(3);
  const auto manifold = MakeRotationManifold();
  for (int trial = 0; trial < kTrials; ++trial) {
    const VectorXd x = Coefficients(random.Rotation());
    const VectorXd y = Coefficients(random.Rotation());
    EXPECT_LT((Minus(*manifold, y, x) - Minus(*manifold, -y, x)).norm(), 1e-14);
  }
}

// Any attitude, and every other time the body's x axis straight up or down.
Quaterniond Attitude(RandomValues& random, int trial) {
  if (trial % 2 == 0) return random.Rotation();
  const double up = trial % 4 == 1 ? -M_PI / 2 : M_PI / 2;
  return Exp(Vector3d(0, 0, random.Uniform(-M_PI, M_PI))) *
         Exp(Vector3d(0, up, 0)) *
         Exp(Vector3d(random.Uniform(-M_PI, M_PI), 0, 0));
}

TEST(GaugeRotationManifold, KeepsTheIdentitiesOfAManifold) {
  RandomValues random(4);
  int trial = 0;
  ExpectManifold(
      *MakeGaugeRotationManifold(),
      random,
      [&] { return Coefficients(Attitude(random, trial++)); },
      M_PI - 1e-3);
}

TEST(GaugeRotationManifold, TangentSpansTheTwoHorizontalAxesAtAnyAttitude) {
  RandomValues random(5);
  const auto gauge = MakeGaugeRotationManifold();
  const auto full = MakeRotationManifold();
  for (int trial = 0; trial < kTrials; ++trial) {
    const Quaterniond q = Attitude(random, trial);
    // The tangent as rotation vectors in G.
    const MatrixXd in_G = q.toRotationMatrix() *
                          MinusJacobian(*full, q.coeffs()) *
                          PlusJacobian(*gauge, q.coeffs());
    EXPECT_LT((in_G - MatrixXd::Identity(3, 2)).norm(), 1e-14);
  }
}

TEST(GaugeRotationManifold, AStepTurnsAboutAHorizontalAxisOnly) {
  RandomValues random(6);
  const auto gauge = MakeGaugeRotationManifold();
  for (int trial = 0; trial < kTrials; ++trial) {
    const Quaterniond q = Attitude(random, trial);
    const Eigen::Vector2d d = random.NormalVector(2);
    const Quaterniond turned = ToRotation(Plus(*gauge, q.coeffs(), d));
    const Vector3d turn_G = Log(turned * q.conjugate());
    EXPECT_NEAR(turn_G.z(), 0, 1e-14);
  }
}

MatrixXd RandomBasis(RandomValues& random, int rows, int cols) {
  return random.NormalVector(rows * cols).reshaped(rows, cols);
}

TEST(SubspaceManifold, KeepsTheIdentitiesOfAManifold) {
  RandomValues random(7);
  for (int rank : {1, 5, 15, 26}) {
    const auto manifold = MakeSubspaceManifold(
        RandomBasis(random, 26, 26).householderQr().householderQ() *
        MatrixXd::Identity(26, rank));
    ASSERT_EQ(manifold->AmbientSize(), 26);
    ASSERT_EQ(manifold->TangentSize(), rank);
    ExpectManifold(
        *manifold, random, [&] { return random.NormalVector(26); }, 10);
  }
}

TEST(SubspaceManifold, HoldsWhatLiesOutsideItsSpan) {
  RandomValues random(8);
  for (int trial = 0; trial < kTrials; ++trial) {
    const int rank = 1 + random.Index(10);
    const MatrixXd basis = RandomBasis(random, 11, rank);
    const auto manifold = MakeSubspaceManifold(basis);
    const VectorXd x = random.NormalVector(11);
    const VectorXd step = Plus(*manifold, x, random.NormalVector(rank)) - x;
    const MatrixXd Q =
        basis.householderQr().householderQ() * MatrixXd::Identity(11, 11);
    EXPECT_LT((Q.rightCols(11 - rank).transpose() * step).norm(), 1e-12);
    EXPECT_GT(step.norm(), 1e-6);
  }
}

TEST(SubspaceManifold, OfRankZeroHoldsEverything) {
  const auto manifold = MakeSubspaceManifold(MatrixXd(4, 0));
  EXPECT_EQ(manifold->TangentSize(), 0);
  const VectorXd x = VectorXd::LinSpaced(4, 1, 4);
  EXPECT_EQ(Plus(*manifold, x, VectorXd(0)), x);
}

}  // namespace
}  // namespace selfcal
