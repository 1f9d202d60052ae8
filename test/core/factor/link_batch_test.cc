// Compares the joined transitions of two IMUs with the rows of both factors.
#include "core/factor/link_batch.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <Eigen/QR>

#include "core/factor/inertial.h"
#include "core/model/second_imu.h"
#include "core/model/so3.h"
#include "test/core/factor/gravity.h"
#include "test/core/factor/random_values.h"

namespace selfcal {
namespace {

constexpr int kState = kMaxChainStateSize;

using RowMajorMatrix =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

struct Case {
  Calibration theta;
  Rig rig;
  KeyframeState x0, x1;
  std::vector<ImuSample> samples[kMaxImus];
};

KeyframeState RandomState(RandomValues& random, std::int64_t t_ns) {
  KeyframeState x = random.State(t_ns);
  x.v_GJ = random.Normal3(2);
  x.b_a1 = random.Normal3(0.2);
  x.b_g1 = random.Normal3(0.02);
  return x;
}

// Readings of any motion, and states that agree with those of the first IMU to
// within a tenth of a radian.
Case RandomCase(RandomValues& random, bool coupled) {
  Case c;
  c.theta.imu = coupled ? random.CoupledImu() : random.Imu();
  c.theta.imu1 = random.SecondImu(coupled);
  c.rig.imu_noise = {.accel_bias_random_walk = 3e-4};
  c.rig.imu1_noise = {2.4e-4, 3e-3, 3e-5, 4e-4};
  c.rig.gravity_mps2 = kGravity;
  for (auto& samples : c.samples) samples = random.Samples(200, 0.1, 0.3);
  c.x0 = RandomState(random, 0);
  c.x1 = RandomState(random, 100'000'000);
  c.x1.q_GI = c.x0.q_GI * Exp(random.Normal3(0.05));
  return c;
}

// Whitened rows over (x0 24, theta_i, x1 24, 1), from the factors alone; the
// derivatives by the mount are differences.
Eigen::MatrixXd FactorRows(const Case& c) {
  const int links = LinkTangentSize(c.theta);
  Eigen::MatrixXd rows = Eigen::MatrixXd::Zero(30, 2 * kState + links + 1);
  for (int imu = 0; imu < 2; ++imu) {
    InertialJacobians J;
    InertialMatrix covariance;
    const auto state = [&](const Calibration& theta, const KeyframeState& x) {
      return StateOfImu(theta, imu, x);
    };
    const auto evaluate = [&](const Calibration& theta,
                              const KeyframeState& x0,
                              const KeyframeState& x1) {
      return EvaluateInertial(c.samples[imu],
                              state(theta, x0),
                              state(theta, x1),
                              ImuOf(theta, imu),
                              NoiseOfImu(c.rig, imu),
                              kGravity,
                              &J,
                              &covariance);
    };
    const InertialResidual r = evaluate(c.theta, c.x0, c.x1);
    const InertialMatrix W = SquareRootInformation(covariance);
    auto of_imu = rows.middleRows<15>(15 * imu);
    of_imu.rightCols<1>() = W * r;
    const auto differences = [&](int column, int size, const auto& moved) {
      constexpr double kStep = 1e-6;
      for (int i = 0; i < size; ++i) {
        Eigen::VectorXd d = kStep * Eigen::VectorXd::Unit(size, i);
        const InertialResidual up = moved(d), down = moved(-d);
        of_imu.col(column + i) = W * (up - down) / (2 * kStep);
      }
    };
    differences(0, kState, [&](const Eigen::VectorXd& d) {
      return evaluate(c.theta, BoxPlus(c.x0, d), c.x1);
    });
    differences(kState, links, [&](const Eigen::VectorXd& d) {
      return evaluate(BoxPlus(c.theta, d), c.x0, c.x1);
    });
    differences(kState + links, kState, [&](const Eigen::VectorXd& d) {
      return evaluate(c.theta, c.x0, BoxPlus(c.x1, d));
    });
  }
  return rows;
}

// The same information in the rows of a transition: A^-1 (x0 - G z) and H z.
Eigen::MatrixXd TransitionRows(const ChainTransition& t) {
  const TransitionColumns& at = t.columns;
  const Eigen::Map<const RowMajorMatrix> G(t.G, kState, at.stride);
  const Eigen::Map<const RowMajorMatrix> H(t.H, t.rows, at.stride);
  const Eigen::MatrixXd A =
      Eigen::Map<const RowMajorMatrix>(t.A, kState, t.noise())
          .leftCols<kState>();
  const auto in_order = [&](const Eigen::MatrixXd& by_z) {
    Eigen::MatrixXd rows(by_z.rows(), at.link_size + kState + 1);
    rows << by_z.leftCols(at.link_size), by_z.middleCols<6>(at.next_pose),
        by_z.middleCols(at.link_size, kState - 6), by_z.col(at.constant);
    return rows;
  };
  Eigen::MatrixXd rows =
      Eigen::MatrixXd::Zero(kState + t.rows, 2 * kState + at.link_size + 1);
  rows.topLeftCorner(kState, kState).setIdentity();
  rows.topRightCorner(kState, rows.cols() - kState) = -in_order(G);
  rows.topRows(kState) = A.partialPivLu().solve(rows.topRows(kState)).eval();
  rows.bottomRightCorner(t.rows, rows.cols() - kState) = in_order(H);
  return rows;
}

TEST(LinkBatch, TwoImusGiveTheRowsOfBothFactorsInAnotherBasis) {
  RandomValues random(3);
  for (int trial = 0; trial < 20; ++trial) {
    const Case c = RandomCase(random, trial % 2 == 1);
    LinkBatch batch(WidestVectors());
    LinkTransitions transitions;
    batch.Linearise(
        {{{{&c.x0, &c.x1, c.samples[0]}}, {{&c.x0, &c.x1, c.samples[1]}}}},
        c.theta,
        c.rig,
        &transitions);
    ASSERT_EQ(transitions.size(), 1u);
    const Eigen::MatrixXd expected = FactorRows(c);
    // The noise of the transition, in the sensors' own order again.
    Eigen::MatrixXd actual = TransitionRows(transitions[0]);
    ASSERT_EQ(actual.rows(), expected.rows());
    for (Eigen::Index j = 0; j < actual.cols(); ++j) {
      actual.col(j) = transitions.NoiseOfImus(0, actual.col(j));
    }
    for (Eigen::Index j = 0; j < actual.cols(); ++j) {
      EXPECT_LT((actual.col(j) - expected.col(j)).norm(),
                1e-5 * expected.col(j).norm())
          << "column " << j << " in trial " << trial;
    }
  }
}

TEST(LinkBatch, OneImuGivesItsOwnTransition) {
  RandomValues random(4);
  Case c = RandomCase(random, false);
  c.theta.imu1.reset();
  LinkBatch batch(WidestVectors());
  LinkTransitions transitions;
  const std::vector<InertialLinkStates> links = {{&c.x0, &c.x1, c.samples[0]}};
  batch.Linearise({links, {}}, c.theta, c.rig, &transitions);
  InertialBatch alone(WidestVectors());
  std::vector<InertialNoiseRoot> roots(1);
  InertialTransitions expected;
  alone.Linearise(
      links, c.theta.imu, c.rig.imu_noise, kGravity, roots, &expected);
  const ChainTransition actual = transitions[0];
  EXPECT_EQ(actual.rows, 0);
  const int size = kChainStateSize * actual.columns.stride;
  EXPECT_TRUE(std::equal(actual.G, actual.G + size, expected[0].G));
  EXPECT_TRUE(std::equal(
      actual.A, actual.A + kChainStateSize * kTransitionNoise, expected[0].A));
}

}  // namespace
}  // namespace selfcal
