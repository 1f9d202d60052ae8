#include "core/coach/advise.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "core/coach/words.h"
#include "test/core/simulation/rigs.h"

namespace selfcal {
namespace {

Eigen::MatrixXd PriorInformation(const Rig& rig) {
  return PriorSigmas(rig).cwiseAbs2().cwiseInverse().asDiagonal();
}

const Advice& AdviceOf(const Coaching& coaching, std::string_view motion) {
  return *std::find_if(
      coaching.advice.begin(),
      coaching.advice.end(),
      [&](const Advice& advice) { return advice.motion == motion; });
}

TEST(Advise, NoMotionReducesTheInformation) {
  const Rig rig = StereoRig();
  const Predictions predictions = Predict(rig, rig.factory);
  Eigen::MatrixXd known = PriorInformation(rig);
  for (int round = 0; round < 4; ++round) {
    const Coaching coaching = Advise(rig, predictions, known);
    ASSERT_EQ(coaching.advice.size(), Primitives().size());
    double last = coaching.advice.front().gain_nats;
    for (const Advice& advice : coaching.advice) {
      EXPECT_GE(advice.gain_nats, 0);
      EXPECT_LE(advice.gain_nats, last);
      last = advice.gain_nats;
      ASSERT_EQ(advice.groups.size(), rig.groups.size());
      for (const GroupGain& group : advice.groups) {
        EXPECT_GE(group.gain_nats, 0);
        EXPECT_LE(group.gain_nats, advice.gain_nats + 1e-9) << group.group;
      }
      ASSERT_EQ(advice.sigmas.size(), FreeComponents(rig).size());
      for (const SigmaChange& sigma : advice.sigmas) {
        EXPECT_LE(sigma.sigma_after, sigma.sigma_now * (1 + 1e-9));
        EXPECT_GT(sigma.sigma_after, 0);
      }
    }
    EXPECT_EQ(coaching.advice.back().motion, "hold_still");
    known += predictions.motions[3].Lambda;
  }
}

// The same motion again doubles the information: sqrt(2) in each of k
// directions.
TEST(Advise, PredictsWhatTheSumOfTheInformationGives) {
  const Rig rig = HandheldRig("r");
  Predictions predictions = Predict(rig, rig.factory);
  predictions.motions.resize(1);
  const Eigen::MatrixXd known = PriorInformation(rig);
  predictions.motions[0].Lambda = known;
  const Coaching coaching = Advise(rig, predictions, known);
  const Advice& advice = coaching.advice.front();
  const auto free = FreeComponents(rig);
  EXPECT_NEAR(advice.gain_nats,
              static_cast<double>(free.size()) / 2 * std::log(2),
              1e-9);
  for (std::size_t q = 0; q < rig.groups.size(); ++q) {
    const auto size = GroupComponents(rig, rig.groups[q]).size();
    EXPECT_EQ(advice.groups[q].group, rig.groups[q].name);
    EXPECT_NEAR(advice.groups[q].gain_nats,
                static_cast<double>(size) / 2 * std::log(2),
                1e-9);
  }
  const auto components = TangentComponents(rig.factory);
  for (std::size_t i = 0; i < free.size(); ++i) {
    const SigmaChange& sigma = advice.sigmas[i];
    EXPECT_EQ(sigma.component, components[free[i]].name);
    EXPECT_EQ(sigma.unit, components[free[i]].unit);
    const double prior = PriorSigmas(rig)[free[i]];
    EXPECT_NEAR(sigma.sigma_now, prior, 1e-9 * prior);
    EXPECT_NEAR(sigma.sigma_after, prior / std::sqrt(2), 1e-9 * prior);
  }
}

TEST(Advise, GivesTheSameAgain) {
  const Rig rig = HandheldRig("r");
  const Predictions predictions = Predict(rig, rig.factory);
  const Eigen::MatrixXd known = PriorInformation(rig);
  const Coaching a = Advise(rig, predictions, known);
  const Coaching b = Advise(rig, predictions, known);
  for (std::size_t i = 0; i < a.advice.size(); ++i) {
    EXPECT_EQ(a.advice[i].motion, b.advice[i].motion);
    EXPECT_EQ(a.advice[i].gain_nats, b.advice[i].gain_nats);
  }
}

TEST(Advise, AMotionHasLessGainOnceItWasDone) {
  const Rig rig = HandheldRig("r");
  const Predictions predictions = Predict(rig, rig.factory);
  const Eigen::MatrixXd known = PriorInformation(rig);
  ASSERT_FALSE(predictions.motions.empty());
  for (const MotionPrediction& motion : predictions.motions) {
    const double before =
        AdviceOf(Advise(rig, predictions, known), motion.motion).gain_nats;
    const double after =
        AdviceOf(Advise(rig, predictions, known + motion.Lambda), motion.motion)
            .gain_nats;
    EXPECT_LT(after, before) << motion.motion;
  }
}

// How strongly each motion excites one axis of a sensor: root mean square of a
// rate, standard deviation of a specific force.
double Excitation(const Rig& rig, const Primitive& motion, int component) {
  const auto trajectory = Perform(motion, rig.factory, 4.1, 1);
  const bool gyro = component < kAccelScale;
  const int axis = component % 3;
  double sum = 0, squares = 0;
  int count = 0;
  for (double t = 0; t < 4.1; t += 0.01) {
    const BodyMotion at = trajectory->At(t);
    const Eigen::Vector3d f_I =
        at.q_GI.conjugate() *
        (at.a_GI + Eigen::Vector3d(0, 0, rig.gravity_mps2));
    const double reading = gyro ? at.w_I[axis] : f_I[axis];
    sum += reading;
    squares += reading * reading;
    ++count;
  }
  const double mean = gyro ? 0 : sum / count;
  return std::sqrt(squares / count - mean * mean);
}

class AdviseOneUnknown : public ::testing::TestWithParam<int> {};

// All but one component are known a thousand times better than a segment
// determines them: the recommended motion excites that one, and the coach names
// it as weak.
TEST_P(AdviseOneUnknown, ExcitesWhatIsUnknown) {
  const int unknown = GetParam();
  const Rig rig = HandheldRig("r");
  Eigen::VectorXd sigmas = 1e-3 * ReferenceSigmas(rig);
  sigmas[unknown] *= 1e4;
  const Eigen::MatrixXd known = sigmas.cwiseAbs2().cwiseInverse().asDiagonal();
  const Coaching coaching = Advise(rig, Predict(rig, rig.factory), known);
  const std::string name = TangentComponents(rig.factory)[unknown].name;
  ASSERT_FALSE(coaching.weakest.empty());
  EXPECT_EQ(coaching.weakest[0].words, ComponentInWords(name));
  EXPECT_NEAR(coaching.weakest[0].sigma, 10, 1e-6);
  double strongest = 0;
  for (const Primitive& motion : Primitives()) {
    strongest = std::max(strongest, Excitation(rig, motion, unknown));
  }
  const Advice& advised = coaching.advice.front();
  EXPECT_GT(Excitation(rig, *FindPrimitive(advised.motion), unknown),
            strongest / 2)
      << advised.motion << " for " << name;
  EXPECT_GT(advised.gain_nats, 2 * AdviceOf(coaching, "hold_still").gain_nats);
}

INSTANTIATE_TEST_SUITE_P(Scales,
                         AdviseOneUnknown,
                         ::testing::Values(kGyroScale,
                                           kGyroScale + 1,
                                           kGyroScale + 2,
                                           kAccelScale,
                                           kAccelScale + 1,
                                           kAccelScale + 2));

TEST(KnownInformation, IsTheInverseOfACovarianceAndWhatCameSince) {
  Rig rig = HandheldRig("r");
  rig.fixed = {"cam0.focal.*"};
  const auto free = FreeComponents(rig);
  Eigen::MatrixXd covariance = PriorSigmas(rig).cwiseAbs2().asDiagonal();
  covariance(0, 1) = covariance(1, 0) = 0.5 * covariance(0, 0);
  const Eigen::MatrixXd known = KnownInformation(rig, rig.factory, covariance);
  const Eigen::MatrixXd product = known(free, free) * covariance(free, free);
  EXPECT_LT(
      (product - Eigen::MatrixXd::Identity(product.rows(), product.cols()))
          .norm(),
      1e-9);
  const int fixed =
      MatchComponents(TangentComponents(rig.factory), rig.fixed).front();
  EXPECT_EQ(known.row(fixed).norm(), 0);

  SegmentInformation segment;
  segment.theta0 = rig.factory;
  segment.Lambda = Predict(rig, rig.factory).motions[1].Lambda;
  segment.eta.setZero(segment.Lambda.rows());
  const Eigen::MatrixXd since =
      KnownInformation(rig, rig.factory, covariance, {{segment, segment}});
  EXPECT_LT((since - known - 2 * segment.Lambda).norm(), 1e-9 * since.norm());
}

TEST(KnownInformation, IsNotFiniteForWhatIsNoCovariance) {
  const Rig rig = HandheldRig("r");
  const auto size = TangentSize(rig.factory);
  const Eigen::MatrixXd identity = Eigen::MatrixXd::Identity(size, size);
  Eigen::MatrixXd indefinite = identity;
  indefinite(0, 1) = indefinite(1, 0) = 2;
  Eigen::MatrixXd flat = identity;
  flat(3, 3) = 0;
  for (const Eigen::MatrixXd& wrong : {indefinite, flat}) {
    EXPECT_FALSE(KnownInformation(rig, rig.factory, wrong).allFinite());
  }
  EXPECT_TRUE(KnownInformation(rig, rig.factory, identity).allFinite());
}

}  // namespace
}  // namespace selfcal
