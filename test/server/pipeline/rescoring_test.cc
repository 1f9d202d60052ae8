// Scores that an update of the rig makes outdated are computed again, also if
// that is interrupted.
#include "server/pipeline/rescoring.h"

#include <stdexcept>

#include "server/domain/clock.h"
#include "test/server/pipeline/pipeline_test.h"
#include "test/server/store/fake_ends.h"

namespace selfcal::server {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

constexpr int kSegments = 3;

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
    const auto updated = pipeline_->UpdateRig(
        "a",
        [](StoredRig stored) -> absl::StatusOr<StoredRig> {
          stored.rig.prior_sigmas.push_back({"imu.gyro.scale.*", 0.5});
          return stored;
        },
        "eve",
        "");
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

}  // namespace
}  // namespace selfcal::server
