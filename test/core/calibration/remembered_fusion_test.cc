#include "core/calibration/remembered_fusion.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cstdint>
#include <set>
#include <string>
#include <vector>

#include "core/calibration/calibrate.h"
#include "core/simulation/simulate.h"

namespace selfcal {
namespace {

// A session of eight segments, of which a calibration has the data of three.
class RememberedFusionTest : public ::testing::Test {
 protected:
  RememberedFusionTest() : truth_(rig_.factory) {
    rig_.factory = PerturbCalibration(truth_, {}, 1);
    segments_ = Session(*MakeHandheld(16.5, 1, 5));
  }

  std::vector<MotionSegment> Session(
      const Trajectory& motion, const std::string& name = "session") const {
    SimulationOptions options;
    options.seed = 5;
    options.keyframes_per_segment = 20;
    options.landmarks_in_view = 60;
    options.revisit_fraction = 0;
    return Simulate(rig_, truth_, rig_.factory, motion, name, options).segments;
  }

  // All segments without data, linearised at theta.
  std::vector<RememberedSegment> RememberedAt(const Calibration& theta) const {
    std::vector<RememberedSegment> remembered;
    for (const MotionSegment& segment : segments_) {
      RememberedSegment& one = remembered.emplace_back();
      one.key = segment.key;
      one.time_ns = segment.keyframes.front().t_ns;
      if (!kept_.contains(segment.key.index)) {
        one.ends = SummariseEnds(rig_, theta, segment);
      }
    }
    return remembered;
  }

  CalibrationResult CalibrateOn(
      const std::set<std::int64_t>& set,
      const std::vector<RememberedSegment>& remembered) const {
    std::vector<MotionSegment> picked;
    for (const std::int64_t i : set) picked.push_back(segments_[i]);
    CalibrateOptions options;
    options.noise_scales = false;
    options.remembered = remembered;
    return Calibrate(rig_, rig_.factory, picked, options);
  }

  // Sigmas of the free components.
  Eigen::VectorXd Sigmas(const CalibrationResult& result) const {
    return result.covariance.diagonal()(FreeComponents(rig_)).cwiseSqrt();
  }
  Eigen::VectorXd Moved(const Calibration& from, const Calibration& to) const {
    return BoxMinus(to, from)(FreeComponents(rig_));
  }

  const std::set<std::int64_t> kept_ = {1, 2, 5};
  const std::set<std::int64_t> all_ = {0, 1, 2, 3, 4, 5, 6, 7};
  Rig rig_ = HandheldRig("r");
  Calibration truth_;
  std::vector<MotionSegment> segments_;
};

// The reference is a calibration on the data of all segments.
TEST_F(RememberedFusionTest, AFewSegmentsWithRememberedOnesEqualAll) {
  ASSERT_EQ(segments_.size(), 8u);
  const CalibrationResult batch = CalibrateOn(all_, {});
  const CalibrationResult alone = CalibrateOn(kept_, {});
  ASSERT_EQ(batch.status, CalibrateStatus::kConverged);
  ASSERT_EQ(alone.status, CalibrateStatus::kConverged);
  const CalibrationResult informed =
      CalibrateOn(kept_, RememberedAt(alone.theta));
  ASSERT_EQ(informed.status, CalibrateStatus::kConverged);
  EXPECT_EQ(informed.remembered.unused, "");
  EXPECT_EQ(informed.remembered.segments, 5);
  EXPECT_EQ(informed.remembered.too_far, 0);
  EXPECT_EQ(informed.remembered.contradicting, 0);
  EXPECT_EQ(informed.remembered.compared, 5);
  EXPECT_EQ(informed.remembered.reach, 0);
  EXPECT_GT(informed.remembered.agreement.degrees, 10);
  EXPECT_GT(informed.remembered.agreement.probability, 1e-3);
  const Eigen::VectorXd ratio = Sigmas(informed).cwiseQuotient(Sigmas(batch));
  EXPECT_GT(Sigmas(alone).cwiseQuotient(Sigmas(batch)).minCoeff(), 1.2);
  // The rest is the information of landmarks that continue.
  EXPECT_LT(ratio.maxCoeff(), 1.15);
  EXPECT_GT(ratio.minCoeff(), 0.98);
  // Reduced information cannot move the estimate by more than a fraction of the
  // sigma, squared differences 1.15^2 - 1 of the variance: 0.57, at 3 sigma.
  EXPECT_LT(Moved(batch.theta, informed.theta)
                .cwiseQuotient(Sigmas(batch))
                .lpNorm<Eigen::Infinity>(),
            1.7);
}

TEST_F(RememberedFusionTest, WithoutMemoryNothingChanges) {
  const CalibrationResult alone = CalibrateOn(kept_, {});
  std::vector<RememberedSegment> own;
  for (const std::int64_t i : kept_) own.push_back({.key = {"session", i}});
  const CalibrationResult same = CalibrateOn(kept_, own);
  EXPECT_TRUE(Moved(alone.theta, same.theta).isZero());
  EXPECT_EQ(same.covariance, alone.covariance);
  EXPECT_EQ(same.remembered.segments, 0);
  EXPECT_EQ(same.remembered.unused, "");
}

// A rotation of a quarter of a degree between two sessions, all with their
// data.
TEST_F(RememberedFusionTest, ReportsThatTheDataIsOfTwoDevices) {
  Eigen::VectorXd turn = Eigen::VectorXd::Zero(TangentSize(truth_));
  const int i =
      MatchComponents(TangentComponents(truth_), {"cam0.q_CI.x"}).at(0);
  turn(i) = 4e-3;
  truth_ = BoxPlus(truth_, turn);
  const auto later = Session(*MakeHandheld(16.5, 1, 6), "later");
  segments_.insert(segments_.end(), later.begin(), later.end());
  std::vector<RememberedSegment> own;
  std::set<std::int64_t> picked;
  for (const std::int64_t k : {1, 2, 5, 6, 9, 10, 13, 14}) {
    picked.insert(k);
    own.push_back({.key = segments_[k].key});
  }
  const CalibrationResult mixed = CalibrateOn(picked, own);
  ASSERT_TRUE(mixed.remembered.split);
  EXPECT_LT(mixed.remembered.split->without_one, 1e-4);
  EXPECT_EQ(mixed.remembered.split->first, (SegmentKey{"later", 1}));
  EXPECT_EQ(mixed.remembered.unused, "");
  // The result is nevertheless that of the newer device.
  EXPECT_GT(mixed.remembered.change_probability, 0.999);
  EXPECT_LT(LargestInSigmas(BoxMinus(mixed.theta, truth_), mixed.covariance),
            3.5);
  EXPECT_GT(mixed.remembered.change_sigmas(i), 0);
  EXPECT_LT(mixed.remembered.change_sigmas(i),
            std::sqrt(mixed.covariance(i, i)));
}

TEST_F(RememberedFusionTest, ExcludesSegmentsThatContradictTheData) {
  const CalibrationResult alone = CalibrateOn(kept_, {});
  std::vector<RememberedSegment> remembered = RememberedAt(alone.theta);
  std::vector<RememberedSegment> without = remembered;
  without.erase(without.begin() + 3);
  const CalibrationResult clean = CalibrateOn(kept_, without);
  SegmentEnds& wrong = *remembered[3].ends;
  const int size = TangentSize(truth_);
  wrong.eta += wrong.Lambda.leftCols(size) * ReferenceSigmas(rig_);
  const CalibrationResult healed = CalibrateOn(kept_, remembered);
  EXPECT_EQ(healed.remembered.contradicting, 1);
  EXPECT_EQ(healed.remembered.segments, 4);
  EXPECT_TRUE(Moved(clean.theta, healed.theta).isZero());
  EXPECT_TRUE((healed.covariance - clean.covariance).isZero());
}

TEST_F(RememberedFusionTest, UsesNoneIfMostContradictTheData) {
  const CalibrationResult alone = CalibrateOn(kept_, {});
  std::vector<RememberedSegment> remembered = RememberedAt(alone.theta);
  const int size = TangentSize(truth_);
  for (RememberedSegment& one : remembered) {
    if (!one.ends) continue;
    one.ends->eta += one.ends->Lambda.leftCols(size) * ReferenceSigmas(rig_);
  }
  const CalibrationResult result = CalibrateOn(kept_, remembered);
  EXPECT_EQ(result.remembered.segments, 0);
  EXPECT_EQ(result.remembered.compared, 5);
  EXPECT_EQ(result.remembered.contradicting, 5);
  EXPECT_NE(result.remembered.unused, "");
  EXPECT_TRUE(Moved(alone.theta, result.theta).isZero());
  EXPECT_EQ(result.covariance, alone.covariance);
}

// The camera was turned. The data is of the device after that, and all that is
// remembered of the device before.
TEST_F(RememberedFusionTest, FindsAChangeBetweenMemoryAndData) {
  const CalibrationResult before = CalibrateOn(all_, {});
  std::vector<RememberedSegment> remembered = RememberedAt(before.theta);
  for (const std::int64_t i : kept_) {
    remembered[i].ends = SummariseEnds(rig_, before.theta, segments_[i]);
  }
  const Calibration first = truth_;
  Eigen::VectorXd turn = Eigen::VectorXd::Zero(TangentSize(truth_));
  const int i =
      MatchComponents(TangentComponents(truth_), {"cam0.q_CI.x"}).at(0);
  // All of them together contradict the data; most of them do.
  for (const double angle : {4e-3, 8e-3}) {
    turn(i) = angle;
    truth_ = BoxPlus(first, turn);
    segments_ = Session(*MakeHandheld(16.5, 1, 6), "later");
    std::vector<RememberedSegment> both = remembered;
    for (const MotionSegment& segment : segments_) {
      both.push_back({.key = segment.key});
    }
    const CalibrationResult after = CalibrateOn(all_, both);
    const RememberedUse& use = after.remembered;
    EXPECT_EQ(use.segments, 0) << angle;
    EXPECT_EQ(use.compared, 8) << angle;
    EXPECT_EQ(2 * use.contradicting > use.compared, angle > 6e-3) << angle;
    ASSERT_TRUE(use.split) << angle;
    EXPECT_LT(use.split->without_one, 1e-4) << angle;
    EXPECT_EQ(use.split->first, (SegmentKey{"later", 0})) << angle;
    // It is calibrated on none of the device before.
    EXPECT_LT(LargestInSigmas(BoxMinus(after.theta, truth_), after.covariance),
              3.5)
        << angle;
  }
}

TEST_F(RememberedFusionTest, IgnoresSegmentsLinearisedTooFarAway) {
  const CalibrationResult alone = CalibrateOn(kept_, {});
  const CalibrationResult result = CalibrateOn(
      kept_, RememberedAt(BoxPlus(alone.theta, 2.1 * ReferenceSigmas(rig_))));
  EXPECT_EQ(result.remembered.segments, 0);
  EXPECT_NE(result.remembered.unused, "");
  EXPECT_TRUE(Moved(alone.theta, result.theta).isZero());
}

// Noise in states looks like information about directions that a rotation in
// place does not observe: remembered segments must not add it.
TEST_F(RememberedFusionTest, DeterminesNoDirectionThatTheDataDoesNot) {
  segments_ = Session(*MakeRotationInPlace(16.5, {.pivot_jitter_m = 0}, 5));
  ASSERT_EQ(segments_.size(), 8u);
  const CalibrationResult alone = CalibrateOn(kept_, {});
  ASSERT_EQ(alone.status, CalibrateStatus::kConverged);
  ASSERT_FALSE(alone.held_constant.empty());
  const CalibrationResult informed =
      CalibrateOn(kept_, RememberedAt(alone.theta));
  EXPECT_EQ(informed.remembered.segments, 5);
  EXPECT_EQ(informed.rank, alone.rank);
  // The position of the camera stays as uncertain as it was.
  const auto components = TangentComponents(truth_);
  int looked_at = 0;
  for (std::size_t i = 0; i < components.size(); ++i) {
    if (components[i].name.find(".p_CI.") == std::string::npos) continue;
    ++looked_at;
    const auto k = static_cast<Eigen::Index>(i);
    EXPECT_GT(informed.covariance(k, k), 0.8 * alone.covariance(k, k));
  }
  EXPECT_EQ(looked_at, 3);
  const std::vector<int> free = FreeComponents(rig_);
  const Eigen::VectorXd error = Moved(informed.theta, truth_);
  const Eigen::MatrixXd covariance = informed.covariance(free, free);
  // Chi-square of 26 degrees, beyond which lie 0.1 %.
  EXPECT_LT(error.dot(covariance.ldlt().solve(error)), 54.1);
}

TEST_F(RememberedFusionTest, RejectsSegmentsOfAnotherShape) {
  std::vector<RememberedSegment> remembered = RememberedAt(rig_.factory);
  remembered[0].ends->eta.resize(5);
  const CalibrationResult result = CalibrateOn(kept_, remembered);
  EXPECT_EQ(result.status, CalibrateStatus::kFailed);
  EXPECT_NE(result.message.find("shape of the rig"), std::string::npos);
}

}  // namespace
}  // namespace selfcal
