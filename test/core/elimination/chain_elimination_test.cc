#include "core/elimination/chain_elimination.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <algorithm>
#include <random>
#include <vector>

#include "core/model/symmetric_eigen.h"
#include "test/core/elimination/random_chain.h"

namespace selfcal {
namespace {

double RelativeError(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  return (a - b).norm() / b.norm();
}

void ExpectEqualsDense(const Chain& chain, ChainElimination* elimination) {
  const SharedInformation actual = Eliminate(chain, elimination);
  const SharedInformation expected = DenseReference(chain);
  EXPECT_LT(RelativeError(actual.Lambda, expected.Lambda), 1e-10);
  EXPECT_LT(RelativeError(actual.eta, expected.eta), 1e-10);
  EXPECT_TRUE(actual.Lambda == actual.Lambda.transpose());
}

constexpr int kLinkSizes[] = {1, 18, 24, kMaxChainLinkSize};

std::vector<RandomChainShape> Shapes() {
  std::vector<RandomChainShape> shapes;
  for (int trial = 0; trial < 36; ++trial) {
    RandomChainShape shape;
    shape.keyframes = 2 + trial % 9;
    shape.link_size = trial % 2 == 0 ? 15 : kLinkSizes[trial / 2 % 4];
    shape.cameras.assign(1 + trial % 3,
                         {.shared = 11 + trial % 4, .rolling = trial % 5 > 2});
    shape.cameras.back() = {11};
    shape.max_track = 1 + trial % 7;
    shape.landmarks_per_keyframe = trial % 5;
    shape.found_again = trial % 2 == 0 ? 0 : 0.3;
    shape.kept = trial % 3 == 0 ? 0.3 : 0;
    shape.turned = trial % 4 < 2;
    if (trial % 4 == 3) {
      shape.state_size = kMaxChainStateSize;
      shape.further_rows = trial % 8 == 3 ? kMaxChainLinkRows : 0;
    }
    shapes.push_back(shape);
  }
  return shapes;
}

// First row of the links in the dense problem.
int FirstLinkRow(const Chain& chain) {
  std::size_t observations = 0;
  for (const auto& track : chain.landmarks) observations += track.size();
  return static_cast<int>(3 * chain.landmarks.size() + 2 * observations) +
         chain.state_size * chain.keyframes();
}

// Calls check(elimination) for every width of this machine.
template <typename Check>
void ForAllWidths(const Check& check) {
  for (const VectorWidth width :
       {VectorWidth::k2, VectorWidth::k4, VectorWidth::k8}) {
    if (!HasVectors(width)) continue;
    SCOPED_TRACE(VectorWidthName(width));
    ChainElimination elimination(width);
    check(&elimination);
  }
}

TEST(ChainElimination, EqualsDenseQrOnRandomChains) {
  // One workspace for all of them.
  ForAllWidths([](ChainElimination* elimination) {
    std::mt19937 random(1);
    for (const RandomChainShape& shape : Shapes()) {
      ExpectEqualsDense(RandomChain(shape, &random), elimination);
    }
  });
}

TEST(ChainElimination, FindsTheStepsThatMinimise) {
  ForAllWidths([](ChainElimination* elimination) {
    std::mt19937 random(9);
    for (const RandomChainShape& shape : Shapes()) {
      const Chain chain = RandomChain(shape, &random);
      Eliminate(chain, elimination, ChainElimination::Record::kSteps);
      // Any step of the shared parameters.
      const int D = chain.shared_size();
      const Eigen::VectorXd shared = Eigen::VectorXd::LinSpaced(D, -1, 2);
      const DenseProblem dense = MakeDense(chain);
      const Eigen::Index others = dense.J.cols() - D;
      const Eigen::VectorXd expected =
          -dense.J.leftCols(others).householderQr().solve(
              dense.r + dense.J.rightCols(D) * shared);
      std::vector<ChainStateVector> states;
      std::vector<Eigen::Vector3d> landmarks;
      elimination->FindSteps(shared, &states, &landmarks);
      Eigen::VectorXd actual(expected.size());
      Eigen::Index at = 0;
      for (const auto& x : landmarks) {
        const int kept = chain.kept_landmarks[at];
        if (kept >= 0) {
          EXPECT_EQ(x, shared.segment<3>(D - chain.kept + kept));
        }
        actual.segment<3>(3 * at++) =
            kept < 0 ? x : Eigen::Vector3d::Zero().eval();
      }
      at *= 3;
      for (const auto& x : states) {
        actual.segment(at, x.size()) = x;
        at += x.size();
      }
      EXPECT_LT(RelativeError(actual, expected), 1e-8);
    }
  });
}

TEST(ChainElimination, FindsThePosterior) {
  ForAllWidths([](ChainElimination* elimination) {
    std::mt19937 random(10);
    for (const RandomChainShape& shape : Shapes()) {
      const Chain chain = RandomChain(shape, &random);
      Eliminate(chain, elimination, ChainElimination::Record::kSteps);
      const DenseProblem dense = MakeDense(chain);
      const int D = chain.shared_size();
      // The shared parameters have the information of the chain and a unit
      // prior.
      Eigen::MatrixXd H = dense.J.transpose() * dense.J;
      H.bottomRightCorner(D, D).diagonal().array() += 1;
      const Eigen::MatrixXd covariance = H.inverse();
      const Eigen::VectorXd step = -covariance * dense.J.transpose() * dense.r;

      std::vector<ChainStateVector> states;
      std::vector<Eigen::Vector3d> landmarks;
      elimination->FindSteps(step.tail(D), &states, &landmarks);
      ChainPosterior posterior;
      elimination->FindPosterior(
          step.tail(D), covariance.bottomRightCorner(D, D), states, &posterior);
      const int first = 3 * static_cast<int>(chain.landmarks.size());
      const int last = chain.keyframes() - 1;
      const int size = chain.state_size;
      const int shared = first + size * (last + 1);
      for (int k = 0; k <= last; ++k) {
        const int at = first + size * k;
        EXPECT_LT(RelativeError(posterior.state_covariance[k],
                                covariance.block(at, at, size, size)),
                  1e-8);
      }
      EXPECT_LT(RelativeError(posterior.first_with_shared,
                              covariance.block(first, shared, size, D)),
                1e-8);
      EXPECT_LT(
          RelativeError(posterior.last_with_shared,
                        covariance.block(first + size * last, shared, size, D)),
          1e-8);
      for (int k = 0; k < last; ++k) {
        const Eigen::Index rows = chain.links[k].residual.size();
        const auto J = dense.J.middleRows(FirstLinkRow(chain) + rows * k, rows);
        const auto r = dense.r.segment(FirstLinkRow(chain) + rows * k, rows);
        EXPECT_LT(RelativeError(posterior.noise[k], r + J * step), 1e-8);
        EXPECT_LT(RelativeError(posterior.noise_covariance[k],
                                J * covariance * J.transpose()),
                  1e-8);
      }
    }
  });
}

TEST(ChainElimination, TracksThroughTheWholeChainAreEliminated) {
  std::mt19937 random(2);
  RandomChainShape shape;
  shape.keyframes = 12;
  shape.max_track = 1;
  Chain chain = RandomChain(shape, &random);
  shape.max_track = 12;
  shape.seen = 1;
  for (auto& track : RandomChain(shape, &random).landmarks) {
    if (track.size() <= 8) continue;
    chain.landmarks.push_back(track);
    chain.kept_landmarks.push_back(-1);
  }
  ChainElimination elimination;
  ExpectEqualsDense(chain, &elimination);
}

TEST(ChainElimination, OneKeyframeNeedsNoLink) {
  std::mt19937 random(3);
  RandomChainShape shape;
  shape.keyframes = 1;
  ChainElimination elimination;
  ExpectEqualsDense(RandomChain(shape, &random), &elimination);
}

TEST(ChainElimination, AReusedWorkspaceGivesTheSameBits) {
  std::mt19937 random(4);
  const Chain chain = RandomChain(RandomChainShape(), &random);
  RandomChainShape larger;
  larger.keyframes = 20;
  larger.cameras = {{11}, {14}};
  ChainElimination fresh;
  const SharedInformation expected = Eliminate(chain, &fresh);
  ChainElimination reused;
  Eliminate(RandomChain(larger, &random), &reused);
  const SharedInformation actual = Eliminate(chain, &reused);
  EXPECT_TRUE(actual.Lambda == expected.Lambda);
  EXPECT_TRUE(actual.eta == expected.eta);
}

TEST(ChainElimination, APriorMayCoupleAllUnknownsOfAKeyframe) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  Chain chain = RandomChain(RandomChainShape(), &random);
  for (ChainStateMatrix& prior : chain.priors) {
    ChainStateMatrix root(chain.state_size, chain.state_size);
    for (auto& x : root.reshaped()) x = normal(random);
    prior = root.transpose() * root;
  }
  ChainElimination elimination;
  ExpectEqualsDense(chain, &elimination);
}

TEST(ChainElimination, RemovingRowsNeverAddsInformation) {
  std::mt19937 random(6);
  ChainElimination elimination;
  for (int trial = 0; trial < 30; ++trial) {
    const Chain chain = RandomChain(RandomChainShape(), &random);
    const Eigen::MatrixXd all = Eliminate(chain, &elimination).Lambda;
    Chain less = chain;
    std::bernoulli_distribution drop(0.2);
    for (auto& track : less.landmarks) {
      std::erase_if(track, [&](const ChainObservation& rows) {
        return &rows != &track.front() && drop(random);
      });
    }
    const Eigen::MatrixXd fewer = Eliminate(less, &elimination).Lambda;
    const Eigen::VectorXd difference = SymmetricEigenvalues(all - fewer);
    EXPECT_GT(difference.minCoeff(), -1e-10 * all.norm());
    EXPECT_GT(difference.maxCoeff(), 0);
  }
}

// Neighbours tied far more tightly than double precision could distinguish if
// the rows were squared: the result is still that of a QR.
TEST(ChainElimination, TightLinksLoseNoPrecision) {
  std::mt19937 random(7);
  for (const double tightness : {1e3, 1e6, 1e9, 1e12}) {
    Chain chain = RandomChain(RandomChainShape(), &random);
    for (ChainRows& link : chain.links) {
      // Biases that hardly walk.
      link.x0.bottomRows<6>().setZero();
      link.x1.bottomRows<6>().setZero();
      link.shared.bottomRows<6>().setZero();
      link.residual.tail<6>().setZero();
      link.x0.bottomRightCorner<6, 6>().diagonal().setConstant(-tightness);
      link.x1.bottomRightCorner<6, 6>().diagonal().setConstant(tightness);
      link.x0.row(2) *= tightness;
      link.x1.row(2) *= tightness;
      link.shared.row(2) *= tightness;
      link.residual(2) *= tightness;
    }
    SCOPED_TRACE(tightness);
    ChainElimination elimination;
    const SharedInformation actual = Eliminate(chain, &elimination);
    const SharedInformation expected = DenseReference(chain);
    EXPECT_LT(RelativeError(actual.Lambda, expected.Lambda), 1e-8);
    EXPECT_LT(RelativeError(actual.eta, expected.eta), 1e-8);
  }
}

TEST(ChainElimination, AnUnknownWithoutInformationGivesAFiniteResult) {
  std::mt19937 random(8);
  Chain chain = RandomChain(RandomChainShape(), &random);
  chain.landmark_prior = 0;
  chain.landmark_prior_slope.setZero();
  for (ChainObservation& rows : chain.landmarks[2]) rows.position.setZero();
  for (auto& track : chain.landmarks) {
    // Three coordinates need at least two observations.
    while (track.size() < 2) track.push_back(track.front());
  }
  ChainElimination elimination;
  const SharedInformation result = Eliminate(chain, &elimination);
  EXPECT_TRUE(result.Lambda.allFinite());
  EXPECT_TRUE(result.eta.allFinite());
}

}  // namespace
}  // namespace selfcal
