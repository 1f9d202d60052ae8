// Segments that contradict the rest are found, named and not used.
#include "core/calibration/segment_agreement.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <functional>
#include <random>
#include <string>

#include "core/calibration/calibrate.h"
#include "core/simulation/simulate.h"

namespace selfcal {
namespace {

constexpr int kSegments = 6;
constexpr int kWrong = 2;

struct Session {
  Rig rig;
  Calibration truth;
  std::vector<MotionSegment> segments;
};

Session MakeSession(int seed,
                    std::uint64_t device_seed = 0,
                    double moving_fraction = 0) {
  Session session{HandheldRig("r"), {}, {}};
  session.truth = session.rig.factory;
  session.rig.factory = PerturbCalibration(session.truth, {}, seed);
  const Calibration device =
      device_seed > 0 ? PerturbCalibration(session.truth, {}, device_seed)
                      : session.truth;
  SimulationOptions options;
  options.seed = seed;
  options.landmarks_in_view = 60;
  options.keyframes_per_segment = 30;
  options.moving_fraction = moving_fraction;
  session.segments = Simulate(session.rig,
                              device,
                              session.rig.factory,
                              *MakeHandheld(3.0 * kSegments + 0.5, 0.7, seed),
                              "session",
                              options)
                         .segments;
  return session;
}

double LargestSigmas(const Session& session, const CalibrationResult& result) {
  const Eigen::VectorXd error = BoxMinus(result.theta, session.truth);
  double largest = 0;
  for (const int i : FreeComponents(session.rig)) {
    largest = std::max(largest,
                       std::abs(error(i)) / std::sqrt(result.covariance(i, i)));
  }
  return largest;
}

void ExpectOnlyTheWrongOneIsLeftOut(const Session& session,
                                    const std::string& reason) {
  const CalibrationResult result =
      Calibrate(session.rig, session.rig.factory, session.segments);
  ASSERT_EQ(result.status, CalibrateStatus::kConverged) << result.message;
  ASSERT_EQ(result.segment_fits.size(), session.segments.size());
  for (int i = 0; i < kSegments; ++i) {
    const SegmentFit& fit = result.segment_fits[i];
    EXPECT_EQ(fit.key, session.segments[i].key);
    if (i == kWrong) {
      EXPECT_NE(fit.excluded.find(reason), std::string::npos) << fit.excluded;
    } else {
      EXPECT_EQ(fit.excluded, "") << i;
    }
  }
  EXPECT_EQ(result.segments, kSegments - 1);
  EXPECT_LT(LargestSigmas(session, result), 4.5);
}

TEST(Contradictions, NoneAreFoundAmongGoodSegments) {
  const Session session = MakeSession(1);
  const CalibrationResult result =
      Calibrate(session.rig, session.rig.factory, session.segments);
  ASSERT_EQ(result.segment_fits.size(), session.segments.size());
  for (const SegmentFit& fit : result.segment_fits) {
    EXPECT_EQ(fit.excluded, "");
    EXPECT_NEAR(fit.pixel_ratio, 1, 0.1);
    EXPECT_NEAR(fit.inertial_ratio, 1, 0.5);
    EXPECT_GT(fit.others.degrees, 15);
    EXPECT_GT(fit.others.probability, 1e-4);
  }
  EXPECT_GT(result.halves.degrees, 20);
  EXPECT_GT(result.halves.probability, 1e-4);
}

TEST(Contradictions, OneReadingOfTheGyroscopeAtTheEndOfItsRange) {
  Session session = MakeSession(2);
  std::vector<ImuSample>& imu = session.segments[kWrong].imu;
  imu[imu.size() / 2].gyro.x() = 35;
  ExpectOnlyTheWrongOneIsLeftOut(session, "residuals");
}

TEST(Contradictions, TimestampsThatAreOffByTenMilliseconds) {
  Session session = MakeSession(3);
  for (ImuSample& sample : session.segments[kWrong].imu) {
    sample.t_ns += 10'000'000;
  }
  // Neighbours may not be joined across it.
  session.segments[kWrong].key.session = "zz";
  std::rotate(session.segments.begin() + kWrong,
              session.segments.begin() + kWrong + 1,
              session.segments.end());
  const CalibrationResult result =
      Calibrate(session.rig, session.rig.factory, session.segments);
  ASSERT_EQ(result.segment_fits.size(), session.segments.size());
  for (const SegmentFit& fit : result.segment_fits) {
    EXPECT_EQ(fit.excluded.empty(), fit.key.session != "zz") << fit.excluded;
  }
  EXPECT_LT(LargestSigmas(session, result), 4.5);
}

TEST(Contradictions, ASegmentOfAnotherDevice) {
  Session session = MakeSession(4);
  session.segments[kWrong] = MakeSession(4, 77).segments[kWrong];
  ExpectOnlyTheWrongOneIsLeftOut(session, "contradicts");
}

TEST(Contradictions, AreFoundWhenTheyPreventConvergence) {
  Session session = MakeSession(4);
  session.segments[kWrong] = MakeSession(4, 77).segments[kWrong];
  CalibrateOptions options;
  options.max_iterations = 8;
  options.exclude_contradictions = false;
  const CalibrationResult with_it =
      Calibrate(session.rig, session.rig.factory, session.segments, options);
  ASSERT_EQ(with_it.status, CalibrateStatus::kNotConverged);
  options.exclude_contradictions = true;
  const CalibrationResult without_it =
      Calibrate(session.rig, session.rig.factory, session.segments, options);
  EXPECT_EQ(without_it.status, CalibrateStatus::kConverged);
  EXPECT_EQ(without_it.segments, kSegments - 1);
  EXPECT_NE(without_it.segment_fits[kWrong].excluded, "");
}

TEST(Contradictions, ASceneThatMoves) {
  Session session = MakeSession(5);
  session.segments[kWrong] = MakeSession(5, 0, 0.9).segments[kWrong];
  ExpectOnlyTheWrongOneIsLeftOut(session, "residuals");
}

// Moves the pixels of every third landmark in a direction of its own, further
// from one keyframe to the next: a feature that slides along an edge.
void LetFeaturesSlide(double px_per_keyframe,
                      std::mt19937* random,
                      MotionSegment* segment) {
  std::uniform_real_distribution<double> angle(0, 2 * EIGEN_PI);
  std::vector<Eigen::Vector2d> slides_px(segment->landmarks.size(),
                                         Eigen::Vector2d::Zero());
  for (std::size_t m = 0; m < slides_px.size(); m += 3) {
    const double a = angle(*random);
    slides_px[m] = px_per_keyframe * Eigen::Vector2d(std::cos(a), std::sin(a));
  }
  const double middle = (segment->keyframes.size() - 1) / 2.0;
  for (Observation& seen : segment->observations) {
    seen.z_px += (seen.keyframe - middle) * slides_px[seen.landmark];
  }
}

// Sums of the tests of each segment against the others.
struct Disagreement {
  double squares = 0;
  int degrees = 0;

  void Add(const CalibrationResult& result) {
    for (const SegmentFit& fit : result.segment_fits) {
      EXPECT_EQ(fit.excluded, "");
      squares += fit.others.statistic;
      degrees += fit.others.degrees;
    }
  }
};

// A robust loss takes influence from large residuals, so that the weights
// predict a larger variance of the gradient (1 / 0.89 of it) than it has.
TEST(Agreement, OfGoodSegmentsIsWhatNoiseExplains) {
  Disagreement all;
  for (int seed = 21; seed < 29; ++seed) {
    const Session session = MakeSession(seed);
    const CalibrationResult result =
        Calibrate(session.rig, session.rig.factory, session.segments);
    ASSERT_EQ(result.status, CalibrateStatus::kConverged);
    all.Add(result);
  }
  ASSERT_GT(all.degrees, 1000);
  // Two and a half standard deviations of independent tests.
  EXPECT_NEAR(all.squares, all.degrees, 2.5 * std::sqrt(2.0 * all.degrees));
}

// Some tracks err by more than others and within the gate: the loss reduces
// their weight in the estimate, and must do so where segments are compared.
TEST(Agreement, IsJudgedByTheWeightsOfTheEstimate) {
  Disagreement all;
  for (std::uint64_t seed = 11; seed < 14; ++seed) {
    Rig rig = HandheldRig("r");
    rig.pixel_sigma_px = kTrackerSigma_px;
    SimulationOptions options;
    options.seed = seed;
    options.mean_track_length = 20;
    options.revisit_fraction = 0;
    std::vector<MotionSegment> segments = Simulate(rig,
                                                   rig.factory,
                                                   rig.factory,
                                                   *MakeHandheld(32.5, 1, seed),
                                                   "session",
                                                   options)
                                              .segments;
    ASSERT_EQ(segments.size(), 8u);
    std::mt19937 random(static_cast<unsigned>(seed));
    for (MotionSegment& segment : segments) {
      LetFeaturesSlide(0.02, &random, &segment);
    }
    rig.pixel_sigma_px = 0.5;
    const CalibrationResult result =
        Calibrate(rig, rig.factory, segments, {.reweight_noise = true});
    ASSERT_EQ(result.status, CalibrateStatus::kConverged);
    all.Add(result);
  }
  ASSERT_GT(all.degrees, 400);
  // No more than what a candidate may have to become active.
  EXPECT_LT(all.squares, 1.3 * all.degrees);
}

SegmentEvidence Drawn(double off_sigmas, std::mt19937* random) {
  constexpr int kSize = 5;
  std::normal_distribution<double> normal;
  SegmentEvidence one;
  one.Lambda = 100 * Eigen::MatrixXd::Identity(kSize, kSize);
  one.eta.resize(kSize);
  for (int i = 0; i < kSize; ++i) {
    one.eta(i) = 10 * (normal(*random) + off_sigmas);
  }
  one.fit.pixel_ratio = one.fit.inertial_ratio = 1;
  return one;
}

// For data drawn from its assumptions, the test has the stated distribution.
TEST(Agreement, HasTheChiSquareDistribution) {
  std::mt19937 random(1);
  constexpr int kTrials = 400;
  double halves = 0, each = 0;
  for (int trial = 0; trial < kTrials; ++trial) {
    std::vector<SegmentEvidence> evidence;
    for (int i = 0; i < 8; ++i) evidence.push_back(Drawn(0, &random));
    TestEach(&evidence);
    each += evidence.front().fit.others.statistic / kTrials;
    EXPECT_EQ(evidence.front().fit.others.degrees, 5);
    halves += TestHalves(evidence, 1).statistic / kTrials;
  }
  // Mean 5, standard deviation of the mean sqrt(10 / 400) = 0.16.
  EXPECT_NEAR(each, 5, 0.6);
  EXPECT_NEAR(halves, 5, 0.6);
}

TEST(Agreement, HalvesThatDifferAreDetected) {
  std::mt19937 random(2);
  std::vector<SegmentEvidence> evidence;
  for (int i = 0; i < 8; ++i)
    evidence.push_back(Drawn(i < 4 ? 2 : -2, &random));
  EXPECT_LT(TestHalves(evidence, 1).probability, 1e-6);
}

TEST(Agreement, AMinorityThatIsOffIsNamed) {
  std::mt19937 random(3);
  std::vector<SegmentEvidence> evidence;
  for (int i = 0; i < 10; ++i) {
    evidence.push_back(Drawn(i == 3 || i == 7 ? 20 : 0, &random));
  }
  std::vector<int> found;
  for (const Contradiction& one : FindContradictions(evidence, true)) {
    found.push_back(one.segment);
  }
  std::sort(found.begin(), found.end());
  EXPECT_EQ(found, (std::vector<int>{3, 7}));
}

TEST(Agreement, LargeResidualsCountOnlyAtAMinimum) {
  std::mt19937 random(4);
  std::vector<SegmentEvidence> evidence;
  for (int i = 0; i < 10; ++i) {
    evidence.push_back(Drawn(i == 3 ? 20 : 0, &random));
    evidence.back().fit.inertial_ratio = i == 4 ? 4 : 1;
  }
  EXPECT_EQ(FindContradictions(evidence, true).size(), 2u);
  const auto found = FindContradictions(evidence, false);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].segment, 3);
}

TEST(Misfits, AreMeasuredRelativeToTypicalFits) {
  // Noise that is stated too small raises all fits alike.
  EXPECT_TRUE(FindMisfits({10, 11, 9, 12, 10}).empty());
  const auto found = FindMisfits({1, 1.1, 4, 0.9, 1});
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].segment, 2);
  // Not measured, or too few to compare with.
  EXPECT_TRUE(FindMisfits({0, 0, 9, 0, 0}).empty());
}

}  // namespace
}  // namespace selfcal
