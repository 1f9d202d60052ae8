#include "core/model/so3.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "core/model/so3_lanes.h"
#include "test/core/model/random_values.h"
#include "test/core/numeric_jacobian.h"

namespace selfcal {
namespace {

constexpr int kRotationTrials = 2000;
constexpr double kPi = std::numbers::pi;

// Rotation vectors of every length up to `max_angle`: many near zero.
Eigen::Vector3d RandomPhi(RandomValues* random, double max_angle) {
  const double angle = random->Uniform(0, 1) < 0.5
                           ? random->Uniform(0, max_angle)
                           : std::abs(random->SignedMagnitude(1e-12, 0.1));
  return angle * random->Direction();
}

TEST(Skew, IsTheCrossProduct) {
  RandomValues random(1);
  for (int i = 0; i < kRotationTrials; ++i) {
    const Eigen::Vector3d a = random.Vector(3, 5);
    const Eigen::Vector3d b = random.Vector(3, 5);
    EXPECT_LT((Skew(a) * b - a.cross(b)).norm(), 1e-14);
  }
}

TEST(Exp, TurnsAboutTheVectorByItsLength) {
  RandomValues random(2);
  for (int i = 0; i < kRotationTrials; ++i) {
    const Eigen::Vector3d axis = random.Direction();
    const double angle = random.Uniform(-10, 10);
    const Eigen::Matrix3d expected =
        Eigen::AngleAxisd(angle, axis).toRotationMatrix();
    const Eigen::Quaterniond q = Exp(angle * axis);
    EXPECT_LT((q.toRotationMatrix() - expected).norm(), 1e-14);
    EXPECT_NEAR(q.norm(), 1, 1e-15);
  }
}

TEST(Exp, IsTheMatrixExponentialAcrossTheSeries) {
  // Terms of the exponential series until they vanish: no switch in there.
  RandomValues random(3);
  for (int i = 0; i < kRotationTrials; ++i) {
    const Eigen::Vector3d phi =
        std::abs(random.SignedMagnitude(1e-12, 1)) * random.Direction();
    Eigen::Matrix3d expected = Eigen::Matrix3d::Identity();
    Eigen::Matrix3d term = Eigen::Matrix3d::Identity();
    for (int n = 1; n < 25; ++n) {
      term = term * Skew(phi) / n;
      expected += term;
    }
    EXPECT_LT((Exp(phi).toRotationMatrix() - expected).norm(), 1e-15);
  }
}

TEST(Log, InvertsExpBelowPi) {
  RandomValues random(4);
  for (int i = 0; i < kRotationTrials; ++i) {
    const Eigen::Vector3d phi = RandomPhi(&random, kPi - 1e-9);
    EXPECT_LE((Log(Exp(phi)) - phi).norm(), 2e-15 * phi.norm() + 1e-300);
  }
}

TEST(Log, KeepsEveryDigitOfTinyRotations) {
  RandomValues random(5);
  for (int i = 0; i < kRotationTrials; ++i) {
    const Eigen::Vector3d phi =
        std::abs(random.SignedMagnitude(1e-300, 1e-3)) * random.Direction();
    EXPECT_LE((Log(Exp(phi)) - phi).stableNorm(), 1e-15 * phi.stableNorm());
  }
  EXPECT_EQ(Log(Exp(Eigen::Vector3d::Zero())), Eigen::Vector3d::Zero());
}

TEST(Log, IsPreciseNearPi) {
  RandomValues random(6);
  for (int i = 0; i < kRotationTrials; ++i) {
    const double angle = kPi - std::abs(random.SignedMagnitude(1e-15, 1e-2));
    const Eigen::Vector3d phi = angle * random.Direction();
    EXPECT_LT((Log(Exp(phi)) - phi).norm(), 4e-15) << angle;
  }
}

TEST(Log, TakesTheShorterWay) {
  RandomValues random(7);
  for (int i = 0; i < kRotationTrials; ++i) {
    const Eigen::Vector3d axis = random.Direction();
    const double angle = random.Uniform(kPi, 2 * kPi);
    const Eigen::Vector3d phi = Log(Exp(angle * axis));
    EXPECT_LE(phi.norm(), kPi);
    EXPECT_LT((phi - (angle - 2 * kPi) * axis).norm(), 1e-14);
  }
}

TEST(Log, IsTheSameForBothSignsOfTheQuaternion) {
  RandomValues random(8);
  for (int i = 0; i < kRotationTrials; ++i) {
    Eigen::Quaterniond q = random.Rotation();
    if (i % 4 == 0) {  // by exactly pi
      q.w() = 0;
      q.normalize();
    }
    const Eigen::Quaterniond minus(-q.w(), -q.x(), -q.y(), -q.z());
    EXPECT_EQ(Log(q), Log(minus));
  }
}

TEST(RightJacobian, IsTheDerivativeOfExp) {
  RandomValues random(9);
  for (int i = 0; i < kRotationTrials; ++i) {
    const Eigen::Vector3d phi = RandomPhi(&random, 2 * kPi);
    const Eigen::MatrixXd numeric = NumericJacobian(
        [&](const Eigen::VectorXd& d) -> Eigen::VectorXd {
          return Log(Exp(phi).conjugate() * Exp(phi + d));
        },
        3,
        1e-3);
    EXPECT_LT((RightJacobian(phi) - numeric).norm(), 1e-11) << phi.norm();
  }
}

TEST(RightJacobianInverse, IsTheDerivativeOfLog) {
  RandomValues random(10);
  for (int i = 0; i < kRotationTrials; ++i) {
    const Eigen::Vector3d phi = RandomPhi(&random, kPi - 0.01);
    const Eigen::MatrixXd numeric = NumericJacobian(
        [&](const Eigen::VectorXd& d) -> Eigen::VectorXd {
          return Log(Exp(phi) * Exp(d));
        },
        3,
        1e-3);
    EXPECT_LT((RightJacobianInverse(phi) - numeric).norm(), 1e-11)
        << phi.norm();
  }
}

TEST(RightJacobianInverse, InvertsTheRightJacobianUpToAndAtPi) {
  RandomValues random(11);
  for (int i = 0; i < kRotationTrials; ++i) {
    const Eigen::Vector3d phi = i % 3 == 0
                                    ? Eigen::Vector3d(kPi * random.Direction())
                                    : RandomPhi(&random, kPi);
    const Eigen::Matrix3d product =
        RightJacobian(phi) * RightJacobianInverse(phi);
    EXPECT_LT((product - Eigen::Matrix3d::Identity()).norm(), 5e-15)
        << phi.norm();
  }
}

TEST(So3, IsContinuousAcrossTheSwitchToTheSeries) {
  RandomValues random(12);
  for (int i = 0; i < kRotationTrials; ++i) {
    const Eigen::Vector3d axis = random.Direction();
    const Eigen::Vector3d below = kSeriesAngle * (1 - 4e-15) * axis;
    const Eigen::Vector3d above = kSeriesAngle * (1 + 4e-15) * axis;
    EXPECT_LT((Exp(below).coeffs() - Exp(above).coeffs()).norm(), 1e-14);
    EXPECT_LT((RightJacobian(below) - RightJacobian(above)).norm(), 1e-14);
    EXPECT_LT(
        (RightJacobianInverse(below) - RightJacobianInverse(above)).norm(),
        1e-14);
  }
}

using Two = Lanes<2>;

// One of the rotations in each lane.
Eigen::Matrix<Two, 3, 1> Both(const Eigen::Vector3d& a,
                              const Eigen::Vector3d& b) {
  Eigen::Matrix<Two, 3, 1> both;
  for (int i = 0; i < 3; ++i) {
    both[i].Set(0, a[i]);
    both[i].Set(1, b[i]);
  }
  return both;
}

template <typename Many, typename One>
double LaneDifference(const Many& many, int lane, const One& one) {
  double sum = 0;
  for (int i = 0; i < one.size(); ++i) {
    sum += std::abs(many.coeff(i)[lane] - one.coeff(i));
  }
  return sum;
}

TEST(So3, IsTheSameInEachLane) {
  // Short and long rotations beside each other, and signs.
  RandomValues random(13);
  for (int i = 0; i < kRotationTrials; ++i) {
    const Eigen::Vector3d phi[2] = {RandomPhi(&random, kPi),
                                    RandomPhi(&random, 5)};
    const Eigen::Matrix<Two, 3, 1> both = Both(phi[0], phi[1]);
    const Eigen::Quaternion<Two> q = Exp(both);
    const Eigen::Matrix<Two, 3, 1> log = Log(q);
    const auto skew = Skew(both);
    const auto J = RightJacobian(both);
    const auto J_inverse = RightJacobianInverse(both);
    for (int lane = 0; lane < 2; ++lane) {
      const Eigen::Vector3d& p = phi[lane];
      EXPECT_EQ(LaneDifference(skew.reshaped(), lane, Skew(p).reshaped()), 0);
      EXPECT_LT(LaneDifference(q.coeffs(), lane, Exp(p).coeffs()), 4e-15);
      EXPECT_LT(LaneDifference(log, lane, Log(Exp(p))), 1e-14);
      EXPECT_LT(LaneDifference(J.reshaped(), lane, RightJacobian(p).reshaped()),
                4e-15);
      EXPECT_LE(
          LaneDifference(
              J_inverse.reshaped(), lane, RightJacobianInverse(p).reshaped()),
          4e-15 * RightJacobianInverse(p).norm());
    }
  }
}

TEST(So3, OfTinyRotationsEachLaneKeepsEveryDigit) {
  RandomValues random(14);
  for (int i = 0; i < kRotationTrials; ++i) {
    const Eigen::Vector3d phi[2] = {
        std::abs(random.SignedMagnitude(1e-300, 1e-3)) * random.Direction(),
        Eigen::Vector3d::Zero()};
    const Eigen::Matrix<Two, 3, 1> log = Log(Exp(Both(phi[0], phi[1])));
    EXPECT_LE(LaneDifference(log, 0, phi[0]), 4e-15 * phi[0].stableNorm());
    EXPECT_EQ(LaneDifference(log, 1, phi[1]), 0);
  }
}

TEST(So3, ByExactlyPiEachLaneTakesTheSameSignAsOne) {
  RandomValues random(15);
  for (int i = 0; i < kRotationTrials; ++i) {
    const Eigen::Quaterniond one(
        Eigen::Vector4d(random.Direction().homogeneous().cwiseProduct(
                            Eigen::Vector4d(1, i % 3 == 0 ? 0 : 1, 1, 0)))
            .normalized());
    Eigen::Quaternion<Two> both;
    for (int k = 0; k < 4; ++k) {
      both.coeffs()[k].Set(0, one.coeffs()[k]);
      both.coeffs()[k].Set(1, -one.coeffs()[k]);
    }
    const Eigen::Matrix<Two, 3, 1> log = Log(both);
    EXPECT_LT(LaneDifference(log, 0, Log(one)), 4e-15);
    EXPECT_LT(LaneDifference(log, 1, Log(one)), 4e-15);
  }
}

}  // namespace
}  // namespace selfcal
