#include "core/elimination/chain_elimination.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <random>

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

TEST(ChainElimination, EqualsDenseQrOnRandomChains) {
  std::mt19937 random(1);
  ChainElimination elimination;  // one workspace for all of them
  for (int trial = 0; trial < 36; ++trial) {
    ChainShape shape;
    shape.keyframes = 2 + trial % 9;
    shape.cameras = 1 + trial % 3;
    shape.camera_size = 11 + trial % 4;
    shape.max_track = 1 + trial % 7;
    shape.landmarks_per_keyframe = trial % 5;
    ExpectEqualsDense(RandomChain(shape, &random), &elimination);
  }
}

TEST(ChainElimination, TracksThroughTheWholeChainAreEliminated) {
  std::mt19937 random(2);
  ChainShape shape;
  shape.keyframes = 12;
  shape.max_track = 1;
  Chain chain = RandomChain(shape, &random);
  shape.max_track = 12;
  shape.seen = 1;
  Chain long_tracks = RandomChain(shape, &random);
  // The longest goes first, so that later ones are shorter than the front.
  std::swap(
      chain.landmarks.front(),
      *std::max_element(
          long_tracks.landmarks.begin(),
          long_tracks.landmarks.begin() + shape.landmarks_per_keyframe,
          [](const auto& a, const auto& b) { return a.size() < b.size(); }));
  ChainElimination elimination;
  ExpectEqualsDense(chain, &elimination);
}

TEST(ChainElimination, OneKeyframeNeedsNoLink) {
  std::mt19937 random(3);
  ChainShape shape;
  shape.keyframes = 1;
  ChainElimination elimination;
  ExpectEqualsDense(RandomChain(shape, &random), &elimination);
}

TEST(ChainElimination, AReusedWorkspaceGivesTheSameBits) {
  std::mt19937 random(4);
  const Chain chain = RandomChain({}, &random);
  ChainShape larger;
  larger.keyframes = 20;
  larger.cameras = 2;
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
  Chain chain = RandomChain({}, &random);
  for (ChainStateMatrix& prior : chain.priors) {
    ChainStateMatrix root;
    for (auto& x : root.reshaped()) x = normal(random);
    prior = root.transpose() * root;
  }
  ChainElimination elimination;
  ExpectEqualsDense(chain, &elimination);
}

TEST(ChainElimination, LeavingRowsOutNeverAddsInformation) {
  std::mt19937 random(6);
  ChainElimination elimination;
  for (int trial = 0; trial < 30; ++trial) {
    const Chain chain = RandomChain({}, &random);
    const Eigen::MatrixXd all = Eliminate(chain, &elimination).Lambda;
    Chain less = chain;
    std::bernoulli_distribution drop(0.2);
    for (auto& track : less.landmarks) {
      std::erase_if(track, [&](const LandmarkRows& rows) {
        return &rows != &track.front() && drop(random);
      });
    }
    const Eigen::MatrixXd fewer = Eliminate(less, &elimination).Lambda;
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> difference(
        all - fewer, Eigen::EigenvaluesOnly);
    EXPECT_GT(difference.eigenvalues().minCoeff(), -1e-10 * all.norm());
    EXPECT_GT(difference.eigenvalues().maxCoeff(), 0);
  }
}

// Neighbours tied far more tightly than double precision could tell from the
// rest if the rows were squared: the result is still that of a QR.
TEST(ChainElimination, TightLinksLoseNoPrecision) {
  std::mt19937 random(7);
  for (const double tightness : {1e3, 1e6, 1e9, 1e12}) {
    Chain chain = RandomChain({}, &random);
    for (LinkRows& link : chain.links) {
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

TEST(ChainElimination, AnUnknownWithoutInformationIsLeftOut) {
  std::mt19937 random(8);
  Chain chain = RandomChain({}, &random);
  chain.landmark_prior = 0;
  for (LandmarkRows& rows : chain.landmarks[2]) rows.landmark.setZero();
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
