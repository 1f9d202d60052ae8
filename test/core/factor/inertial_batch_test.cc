// Compares the factors of many links at once with each factor alone.
#include "core/factor/inertial_batch.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>

#include "core/factor/inertial.h"
#include "core/model/so3.h"
#include "test/core/factor/gravity.h"
#include "test/core/factor/random_values.h"

namespace selfcal {
namespace {

using Eigen::Vector3d;

using Transition = Eigen::Matrix<double, 15, Eigen::Dynamic>;

template <int columns>
using RowMajor =
    Eigen::Map<const Eigen::Matrix<double, 15, columns, Eigen::RowMajor>>;

Transition GOf(const InertialTransition& t) {
  return RowMajor<Eigen::Dynamic>(t.G, 15, t.columns.stride);
}

Eigen::Matrix<double, 15, kTransitionNoise> AOf(const InertialTransition& t) {
  return RowMajor<kTransitionNoise>(t.A);
}

InertialResidual WhitenedOf(const InertialTransition& t) {
  return Eigen::Map<const InertialResidual>(t.whitened);
}

InertialMatrix MatrixOf(const InertialNoiseRoot& root) {
  using RowMajor = Eigen::Matrix<double, 9, 9, Eigen::RowMajor>;
  InertialMatrix U = InertialMatrix::Zero();
  using ByBias = Eigen::Matrix<double, 9, 6, Eigen::RowMajor>;
  U.topLeftCorner<9, 9>() = Eigen::Map<const RowMajor>(&root.motion[0][0]);
  U.topRightCorner<9, 6>() =
      Eigen::Map<const ByBias>(&root.motion_by_bias[0][0]);
  U.diagonal().tail<6>() =
      Eigen::Map<const Eigen::Matrix<double, 6, 1>>(root.bias);
  return U;
}

struct Link {
  KeyframeState x0, x1;
  std::vector<ImuSample> samples;
};

// Random states, except that the rotation residual is Exp(error).
Link RandomLink(RandomValues& random,
                const ImuCalibration& imu,
                double rate_hz,
                double duration_s,
                const Vector3d& error) {
  Link link;
  link.samples = random.Samples(rate_hz, duration_s);
  link.x0 = random.State(0);
  link.x1 = random.State(static_cast<std::int64_t>(1e9 * duration_s));
  const Preintegration motion = Preintegrate(link.samples,
                                             link.x0.t_ns,
                                             link.x1.t_ns,
                                             imu,
                                             link.x0.b_a,
                                             link.x0.b_g,
                                             {});
  link.x1.q_GI = (link.x0.q_GI * motion.Delta_R * Exp(error)).normalized();
  return link;
}

// Links of different rates, durations and residuals, up to next to pi.
struct Problem {
  ImuCalibration imu;
  ImuNoise noise;
  std::vector<Link> links;

  std::vector<InertialLinkStates> States() const {
    std::vector<InertialLinkStates> states;
    for (const Link& link : links) {
      states.push_back({&link.x0, &link.x1, link.samples});
    }
    return states;
  }
};

Problem RandomProblem(RandomValues& random, int count, bool coupled = false) {
  Problem problem;
  problem.imu = coupled ? random.CoupledImu() : random.Imu();
  for (int i = 0; i < count; ++i) {
    const double angle =
        i % 3 == 0 ? random.Uniform(0, 3.1) : random.LogUniform(1e-6, 0.1);
    problem.links.push_back(RandomLink(random,
                                       problem.imu,
                                       random.LogUniform(50, 500),
                                       random.LogUniform(0.02, 1),
                                       angle * random.Normal3(1).normalized()));
  }
  return problem;
}

struct Result {
  std::vector<InertialNoiseRoot> roots;
  InertialTransitions transitions;
};

Result Linearise(InertialBatch* batch, const Problem& problem) {
  Result result;
  result.roots.resize(problem.links.size());
  batch->Linearise(problem.States(),
                   problem.imu,
                   problem.noise,
                   kGravity,
                   result.roots,
                   &result.transitions);
  return result;
}

// Of numbers of the same unit: three rows of a column.
template <class Matrix>
double WorstDifference(const Matrix& actual, const Matrix& expected) {
  double worst = 0;
  for (int c = 0; c < expected.cols(); ++c) {
    for (int row = 0; row < 15; row += 3) {
      const auto block = expected.template block<3, 1>(row, c);
      const double size = block.norm() + 1e-3 * expected.col(c).norm();
      worst = std::max(worst,
                       (actual.template block<3, 1>(row, c) - block).norm() /
                           (size + 1e-300));
    }
  }
  return worst;
}

class InertialBatchTest : public testing::TestWithParam<VectorWidth> {
 protected:
  void SetUp() override {
    if (!HasVectors(GetParam())) GTEST_SKIP() << "not on this machine";
  }
};

INSTANTIATE_TEST_SUITE_P(
    Widths,
    InertialBatchTest,
    testing::Values(VectorWidth::k2, VectorWidth::k4, VectorWidth::k8),
    [](const auto& info) { return std::string(VectorWidthName(info.param)); });

TEST_P(InertialBatchTest, SolvesEachFactorForTheEarlierState) {
  RandomValues random(1);
  InertialBatch batch(GetParam());
  for (int trial = 0; trial < 80; ++trial) {
    const Problem problem =
        RandomProblem(random, 1 + trial % 40, /*coupled=*/trial >= 40);
    const Result result = Linearise(&batch, problem);
    for (std::size_t i = 0; i < problem.links.size(); ++i) {
      const Link& link = problem.links[i];
      InertialJacobians J;
      InertialMatrix covariance;
      const InertialResidual r = EvaluateInertial(link.samples,
                                                  link.x0,
                                                  link.x1,
                                                  problem.imu,
                                                  problem.noise,
                                                  kGravity,
                                                  &J,
                                                  &covariance);
      const TransitionColumns at(ImuTangentSize(problem.imu));
      Transition z = Transition::Zero(15, at.stride);
      z.leftCols(at.link_size) = J.theta;
      z.middleCols<9>(at.link_size) = J.x1.rightCols<9>();
      z.col(at.constant) = r;
      z.middleCols<6>(at.next_pose) = J.x1.leftCols<6>();
      const Eigen::FullPivLU<InertialMatrix> J0(J.x0);
      const InertialMatrix W = SquareRootInformation(covariance);
      const InertialMatrix U = W.inverse();
      Eigen::Matrix<double, 15, kTransitionNoise> A;
      A << J0.solve(U), InertialResidual::Zero();

      const InertialTransition solved = result.transitions[i];
      EXPECT_LT(WorstDifference(GOf(solved), Transition(-J0.solve(z))), 1e-11);
      EXPECT_LT(WorstDifference(AOf(solved), A), 1e-11);
      EXPECT_LT((MatrixOf(result.roots[i]) - U).norm(), 1e-12 * U.norm());
      EXPECT_LT((WhitenedOf(solved) - W * r).norm(), 1e-11 * (W * r).norm());
      if (HasFailure()) FAIL() << "trial " << trial << ", link " << i;
    }
  }
}

TEST_P(InertialBatchTest, ALinkDoesNotDependOnItsNeighbours) {
  RandomValues random(2);
  InertialBatch batch(GetParam());
  const Problem problem = RandomProblem(random, 23, /*coupled=*/true);
  const Result together = Linearise(&batch, problem);
  for (std::size_t i = 0; i < problem.links.size(); ++i) {
    Problem alone = problem;
    alone.links = {problem.links[i]};
    const Result one = Linearise(&batch, alone);
    const InertialTransition a = one.transitions[0];
    const InertialTransition b = together.transitions[i];
    EXPECT_LT(WorstDifference(GOf(a), GOf(b)), 1e-12);
    EXPECT_LT(WorstDifference(AOf(a), AOf(b)), 1e-12);
    EXPECT_LT((WhitenedOf(a) - WhitenedOf(b)).norm(),
              1e-12 * WhitenedOf(b).norm());
  }
}

TEST_P(InertialBatchTest, TakesRootsAsGiven) {
  RandomValues random(3);
  InertialBatch batch(GetParam());
  const Problem problem = RandomProblem(random, 11, /*coupled=*/true);
  Problem louder = problem;
  louder.noise.gyro_noise_density *= 3;
  louder.noise.accel_noise_density *= 0.5;
  louder.noise.accel_bias_random_walk *= 7;
  const Result expected = Linearise(&batch, louder);
  InertialTransitions transitions;
  std::vector<InertialResidual> whitened(problem.links.size());
  batch.LineariseWithRoots(
      problem.States(), problem.imu, kGravity, expected.roots, &transitions);
  batch.Residuals(
      problem.States(), problem.imu, kGravity, expected.roots, whitened);
  for (std::size_t i = 0; i < problem.links.size(); ++i) {
    const InertialTransition of = expected.transitions[i];
    EXPECT_LT(WorstDifference(GOf(transitions[i]), GOf(of)), 1e-13);
    EXPECT_LT(WorstDifference(AOf(transitions[i]), AOf(of)), 1e-13);
    const double size = WhitenedOf(of).norm();
    EXPECT_LT((WhitenedOf(transitions[i]) - WhitenedOf(of)).norm(),
              1e-13 * size);
    EXPECT_LT((whitened[i] - WhitenedOf(of)).norm(), 1e-13 * size);
  }
}

// Few links of any length.
Problem AnyLinks(RandomValues& random) {
  Problem problem = RandomProblem(random, 0);
  for (int i = 0; i < 3; ++i) {
    problem.links.push_back(RandomLink(random,
                                       problem.imu,
                                       random.LogUniform(10, 1000),
                                       random.LogUniform(1e-8, 1),
                                       random.Normal3(0.1)));
  }
  return problem;
}

TEST_P(InertialBatchTest, RootsAreThoseOfTheCovariance) {
  RandomValues random(4);
  InertialBatch batch(GetParam());
  for (int trial = 0; trial < 500; ++trial) {
    Problem problem = AnyLinks(random);
    problem.noise = {.gyro_noise_density = random.LogUniform(1e-5, 1e-2),
                     .accel_noise_density = random.LogUniform(1e-4, 1e-1),
                     .gyro_bias_random_walk = random.LogUniform(1e-7, 1e-2),
                     .accel_bias_random_walk = random.LogUniform(1e-6, 1e-1)};
    const Result result = Linearise(&batch, problem);
    for (std::size_t i = 0; i < problem.links.size(); ++i) {
      const Link& link = problem.links[i];
      InertialMatrix covariance;
      EvaluateInertial(link.samples,
                       link.x0,
                       link.x1,
                       problem.imu,
                       problem.noise,
                       kGravity,
                       nullptr,
                       &covariance);
      const InertialMatrix U = MatrixOf(result.roots[i]);
      EXPECT_TRUE(U.isUpperTriangular(0));
      EXPECT_GT(U.diagonal().minCoeff(), 0);
      const InertialMatrix weight =
          covariance.diagonal().cwiseSqrt().cwiseInverse().asDiagonal();
      EXPECT_LT((weight * (U * U.transpose() - covariance) * weight)
                    .cwiseAbs()
                    .maxCoeff(),
                1e-12);
      if (HasFailure()) FAIL() << "trial " << trial << ", link " << i;
    }
  }
}

TEST_P(InertialBatchTest, IsFiniteForAnyPositiveNoise) {
  RandomValues random(5);
  InertialBatch batch(GetParam());
  for (int trial = 0; trial < 1000; ++trial) {
    Problem problem = AnyLinks(random);
    problem.noise = {.gyro_noise_density = random.LogUniform(1e-12, 1e6),
                     .accel_noise_density = random.LogUniform(1e-12, 1e6),
                     .gyro_bias_random_walk = random.LogUniform(1e-12, 1e6),
                     .accel_bias_random_walk = random.LogUniform(1e-12, 1e6)};
    const Result result = Linearise(&batch, problem);
    for (std::size_t i = 0; i < problem.links.size(); ++i) {
      EXPECT_TRUE(GOf(result.transitions[i]).allFinite());
      EXPECT_TRUE(AOf(result.transitions[i]).allFinite());
      EXPECT_TRUE(WhitenedOf(result.transitions[i]).allFinite());
      const Link& link = problem.links[i];
      InertialMatrix covariance;
      EvaluateInertial(link.samples,
                       link.x0,
                       link.x1,
                       problem.imu,
                       problem.noise,
                       kGravity,
                       nullptr,
                       &covariance);
      const InertialMatrix U = MatrixOf(result.roots[i]);
      EXPECT_GT(U.diagonal().minCoeff(), 0);
      for (int row = 0; row < 15; ++row) {
        EXPECT_LT(U.row(row).cwiseAbs().maxCoeff(),
                  1.01 * std::sqrt(covariance(row, row)));
      }
      if (HasFailure()) FAIL() << "trial " << trial << ", link " << i;
    }
  }
}

TEST_P(InertialBatchTest, AtRestBesideALongerLinkThatMoves) {
  RandomValues random(6);
  InertialBatch batch(GetParam());
  Problem problem = RandomProblem(random, 1);
  // One step, without any rate.
  Link rest;
  rest.x1.t_ns = 1'000'000;
  const Vector3d f =
      problem.imu.T_a() * (problem.imu.q_AI * Vector3d(0, 0, kGravity));
  rest.samples = {{-1, Vector3d::Zero(), f}, {1'000'001, Vector3d::Zero(), f}};
  problem.links.push_back(rest);
  const Result result = Linearise(&batch, problem);
  EXPECT_TRUE(GOf(result.transitions[1]).allFinite());
  EXPECT_TRUE(AOf(result.transitions[1]).allFinite());
  // The residual vanishes but for rounding.
  const InertialTransition t = result.transitions[1];
  EXPECT_LT(GOf(t).col(t.columns.constant).norm(), 1e-15);
}

TEST_P(InertialBatchTest, NoLinksAreNoWork) {
  InertialBatch batch(GetParam());
  RandomValues random(7);
  EXPECT_EQ(Linearise(&batch, RandomProblem(random, 0)).transitions.size(), 0u);
}

}  // namespace
}  // namespace selfcal
