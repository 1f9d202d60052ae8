// Scores that an update of the rig makes outdated are computed again, also if
// that is interrupted, and so are those at a candidate that does not become
// active.
#include "server/pipeline/rescoring.h"

#include <functional>
#include <stdexcept>
#include <thread>

#include "server/domain/clock.h"
#include "test/server/pipeline/pipeline_test.h"
#include "test/server/store/fake_ends.h"

namespace selfcal::server {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

constexpr int kSegments = 3;

absl::StatusOr<StoredRig> WithAnotherPrior(StoredRig stored) {
  stored.rig.prior_sigmas.push_back({"imu.gyro.scale.*", 0.5});
  return stored;
}

class RescoringTest : public PipelineTest {
 protected:
  RescoringTest() {
    options_.recheck = std::chrono::milliseconds(5);
    options_.now_ns = [this] { return NowNs() + late_ns_; };
    estimators_.score =
        [this](const Rig& rig, const Calibration&, const MotionSegment&) {
          if (scores_left_-- <= 0) throw std::runtime_error("no more scores");
          return FakeInformation(rig, EntropyWith(rig));
        };
    estimators_.ends =
        [](const Rig& rig, const Calibration&, const MotionSegment& segment) {
          return FakeEnds(rig, segment.key);
        };
  }
  ~RescoringTest() override { pipeline_.reset(); }

  // Entropy of scores with the prior of the rig.
  static double EntropyWith(const Rig& rig) { return -PriorSigmas(rig).sum(); }

  // Segments that the tables, which are not full, keep.
  void SubmitAll() {
    Rig rig = TestRig("a");
    rig.table_size = 2 * kSegments;
    ASSERT_TRUE(domain_->CreateRig(rig).ok());
    StartOne();
    for (int k = 0; k < kSegments; ++k) Submit(k);
    ASSERT_TRUE(AllScored());
    ASSERT_EQ(WithPresentPrior(), kSegments);
  }

  void ChangePrior() {
    const auto updated = pipeline_->UpdateRig("a", WithAnotherPrior, "eve", "");
    ASSERT_TRUE(updated.ok()) << updated.status();
  }

  // Segments whose score has the present prior.
  int WithPresentPrior() {
    const double expected = EntropyWith(store_->GetRig("a")->rig);
    int present = 0;
    for (int k = 0; k < kSegments; ++k) {
      const auto segment = store_->GetSegment("a", Segment(k).key);
      EXPECT_TRUE(segment.ok() && segment->has_data && segment->information);
      present += segment->information->groups[0].entropy == expected ? 1 : 0;
    }
    return present;
  }

  std::vector<std::string> Outdated() {
    return store_->ListRigsToCheck(RigCheck::kScores, kNoCheck, 10).value();
  }

  std::atomic<int> scores_left_ = 1000;
  std::atomic<std::int64_t> late_ns_ = 0;  // of the time of the pipeline
};

TEST_F(RescoringTest, AnUpdateEndsWithAllScores) {
  SubmitAll();
  ChangePrior();
  EXPECT_EQ(WithPresentPrior(), kSegments);
  EXPECT_THAT(Outdated(), IsEmpty());
}

TEST_F(RescoringTest, WhatFailedHalfWayIsResumedAfterARestart) {
  SubmitAll();
  scores_left_ = 1;
  ChangePrior();
  EXPECT_EQ(WithPresentPrior(), 1);
  EXPECT_THAT(Outdated(), ElementsAre("a"));
  pipeline_.reset();
  scores_left_ = 1000;
  late_ns_ = 120'000'000'000;
  Restart();
  EXPECT_TRUE(Eventually([&] { return Outdated().empty(); }));
  EXPECT_EQ(WithPresentPrior(), kSegments);
}

TEST_F(RescoringTest, WhatFailsIsTriedAgainWithoutARestart) {
  SubmitAll();
  scores_left_ = 0;
  ChangePrior();
  EXPECT_EQ(WithPresentPrior(), 0);
  // Each attempt is due, a minute after the one before: the clock of the
  // records stays two minutes behind.
  late_ns_ = 120'000'000'000;
  EXPECT_TRUE(Eventually([&] { return scores_left_ < -2; }));
  scores_left_ = 1000;
  EXPECT_TRUE(Eventually([&] { return Outdated().empty(); }));
  EXPECT_EQ(WithPresentPrior(), kSegments);
}

// A daemon that dies after the transaction of the update.
TEST_F(RescoringTest, AnUpdateOfADaemonThatDiedIsContinuedByAnother) {
  SubmitAll();
  pipeline_.reset();
  ASSERT_TRUE(
      domain_
          ->UpdateRig(
              "a",
              [](StoredRig stored) -> absl::StatusOr<StoredRig> {
                stored.rig.prior_sigmas.push_back({"imu.gyro.scale.*", 0.5});
                return stored;
              },
              "eve")
          .ok());
  EXPECT_EQ(WithPresentPrior(), 0);
  options_.replica = {.shared = true,
                      .beat = std::chrono::milliseconds(20),
                      .lease = std::chrono::milliseconds(400)};
  late_ns_ = 120'000'000'000;
  StartOne();
  EXPECT_TRUE(Eventually([&] { return Outdated().empty(); }));
  EXPECT_EQ(WithPresentPrior(), kSegments);
}

// The scores show the calibration at which they were computed. Tables of 2: two
// segments start the run.
class RescoringOfRunTest : public PipelineTest {
 protected:
  RescoringOfRunTest() {
    options_.recheck = std::chrono::milliseconds(5);
    options_.session_idle = std::chrono::milliseconds(0);
    // Outdated scores are due at once: the clock of the records stays behind.
    options_.now_ns = [] { return NowNs() + 120'000'000'000; };
    estimators_.score =
        [this](const Rig& rig, const Calibration& theta, const MotionSegment&) {
          if (EntropyAt(theta) == AtCandidate() && ++at_candidate_ == 2) {
            on_second_at_candidate_();
          }
          return FakeInformation(rig, EntropyAt(theta));
        };
    estimators_.ends =
        [](const Rig& rig, const Calibration&, const MotionSegment& segment) {
          return FakeEnds(rig, segment.key);
        };
  }
  ~RescoringOfRunTest() override { pipeline_.reset(); }

  static double EntropyAt(const Calibration& theta) {
    return -theta.cameras[0].f.x();
  }
  static double AtFactory() { return EntropyAt(TestRig("a").factory); }
  static double AtCandidate() {
    const Rig rig = TestRig("a");
    return EntropyAt(Converged(rig, rig.factory).theta);
  }

  void RunOnTwoSegments() {
    CreateRig();
    StartOne();
    Submit(0);
    Submit(1);
  }

  double Entropy(std::int64_t index) {
    const auto segment = store_->GetSegment("a", Segment(index).key);
    EXPECT_TRUE(segment.ok() && segment->information);
    return segment->information->groups[0].entropy;
  }
  std::vector<double> Entropies() { return {Entropy(0), Entropy(1)}; }
  std::vector<std::string> Outdated() {
    return store_->ListRigsToCheck(RigCheck::kScores, kNoCheck, 10).value();
  }
  bool IsRepaired() {
    return Eventually([&] { return Outdated().empty(); });
  }

  std::function<void()> on_second_at_candidate_ = [] {};
  std::atomic<int> at_candidate_ = 0;  // scores so far
};

TEST_F(RescoringOfRunTest, ARunEndsWithAllScoresAtItsVersion) {
  RunOnTwoSegments();
  ASSERT_TRUE(RunIs(RunState::kSucceeded));
  EXPECT_EQ(store_->GetActiveCalibration("a")->version, 2);
  EXPECT_THAT(Entropies(), ElementsAre(AtCandidate(), AtCandidate()));
  EXPECT_TRUE(IsRepaired());
  EXPECT_EQ(at_candidate_, 2);
}

// Another daemon cancels it: the one that executes it learns of that later.
TEST_F(RescoringOfRunTest, ACancelledRunLeavesNoScoreAtItsCandidate) {
  on_second_at_candidate_ = [&] {
    EXPECT_THAT(Entropies(), ElementsAre(AtCandidate(), AtFactory()));
    EXPECT_THAT(Outdated(), ElementsAre("a"));
    EXPECT_TRUE(
        domain_->EndRun("a", 1, RunState::kCancelled, "on request").ok());
  };
  RunOnTwoSegments();
  ASSERT_TRUE(RunIs(RunState::kCancelled));
  EXPECT_TRUE(IsRepaired());
  EXPECT_THAT(Entropies(), ElementsAre(AtFactory(), AtFactory()));
  EXPECT_EQ(store_->GetActiveCalibration("a")->version, 1);
}

TEST_F(RescoringOfRunTest, ARejectedVersionLeavesNoScore) {
  on_second_at_candidate_ = [&] {
    EXPECT_TRUE(domain_->QuarantineSegments("a", "s", 1, "eve", "wrong").ok());
  };
  RunOnTwoSegments();
  ASSERT_TRUE(RunIs(RunState::kSucceeded));
  EXPECT_TRUE(IsRepaired());
  EXPECT_EQ(store_->GetCalibration("a", 2)->state, CalibrationState::kRejected);
  EXPECT_EQ(Entropy(0), AtFactory());
}

// A second thread looks for outdated scores meanwhile, many times.
TEST_F(RescoringOfRunTest, OthersWaitWhileARunScoresAtItsCandidate) {
  options_.solver_processes = 2;
  on_second_at_candidate_ = [&] {
    std::this_thread::sleep_for(20 * options_.recheck);
    EXPECT_THAT(Entropies(), ElementsAre(AtCandidate(), AtFactory()));
  };
  RunOnTwoSegments();
  ASSERT_TRUE(RunIs(RunState::kSucceeded));
  EXPECT_THAT(Entropies(), ElementsAre(AtCandidate(), AtCandidate()));
  EXPECT_TRUE(IsRepaired());
}

TEST_F(RescoringOfRunTest, AnUpdateDuringARunEndsWithAllScoresAtItsVersion) {
  on_second_at_candidate_ = [&] {
    const auto updated = pipeline_->UpdateRig("a", WithAnotherPrior, "eve", "");
    EXPECT_TRUE(updated.ok()) << updated.status();
    EXPECT_THAT(Entropies(), ElementsAre(AtCandidate(), AtFactory()));
  };
  RunOnTwoSegments();
  ASSERT_TRUE(RunIs(RunState::kSucceeded));
  EXPECT_TRUE(IsRepaired());
  EXPECT_THAT(Entropies(), ElementsAre(AtCandidate(), AtCandidate()));
  EXPECT_EQ(store_->GetActiveCalibration("a")->version, 2);
}

// The third daemon died while it scored at the candidate.
TEST_F(RescoringOfRunTest, ARunThatIsGivenUpLeavesNoScoreAtItsCandidate) {
  const Rig rig = CreateRig();
  for (const std::int64_t index : {0, 1}) {
    const SegmentKey key = Segment(index).key;
    ASSERT_TRUE(domain_->PutSegment("a", Segment(index)).ok());
    ASSERT_TRUE(
        domain_
            ->CommitScore(
                "a", key, FakeInformation(rig, AtFactory()), FakeEnds(rig, key))
            .ok());
  }
  for (int k = 0; k < 3; ++k) ASSERT_TRUE(domain_->BeginRun("a", 1).ok());
  ASSERT_TRUE(domain_->NoteCandidateScores("a", 1).ok());
  ASSERT_TRUE(domain_
                  ->ReplaceScore("a",
                                 {1, PriorSigmas(rig), 1},
                                 Segment(0).key,
                                 FakeInformation(rig, AtCandidate()),
                                 FakeEnds(rig, Segment(0).key))
                  .ok());
  StartOne();
  ASSERT_TRUE(RunIs(RunState::kFailed));
  EXPECT_TRUE(IsRepaired());
  EXPECT_THAT(Entropies(), ElementsAre(AtFactory(), AtFactory()));
}

}  // namespace
}  // namespace selfcal::server
