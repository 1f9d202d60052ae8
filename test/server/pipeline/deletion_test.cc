// Deletion beside scoring and storing: whatever is being scored is waited for,
// nothing of a deleted rig comes back, and nobody waits for each other.
#include <future>

#include "test/server/pipeline/pipeline_test.h"
#include "test/support/eventually.h"

namespace selfcal::server {
namespace {

class DeletionTest : public PipelineTest {
 protected:
  ~DeletionTest() override {
    blocked_ = false;
    pipeline_.reset();
  }

  void BlockScores() {
    blocked_ = true;
    estimators_.score =
        [this](const Rig& rig, const Calibration&, const MotionSegment& s) {
          ++scoring_;
          EXPECT_TRUE(Eventually([this] { return !blocked_; }));
          return FakeInformation(rig, EntropyOf(s.key.index));
        };
  }

  bool AScoreIsUnderWay() {
    return Eventually([&] { return scoring_ > 0; });
  }

  void CreateRig() {
    Rig rig = TestRig("a");
    rig.table_size = 8;
    ASSERT_TRUE(domain_->CreateRig(rig).ok());
  }

  std::atomic<bool> blocked_ = false;
  std::atomic<int> scoring_ = 0;
};

TEST_F(DeletionTest, RigIsDeletedOnceNothingOfItIsScoredAndCanBeMadeAgain) {
  options_.max_backlog = 3;
  BlockScores();
  CreateRig();
  StartOne();
  for (int k = 0; k < 3; ++k) Submit(k);
  ASSERT_TRUE(AScoreIsUnderWay());
  auto deleted = std::async(std::launch::async, [&] {
    return pipeline_->DeleteRig("a", "eve", "sold");
  });
  // It waits for the segment at hand.
  EXPECT_EQ(deleted.wait_for(std::chrono::milliseconds(100)),
            std::future_status::timeout);
  EXPECT_TRUE(store_->GetRig("a").ok());
  blocked_ = false;
  ASSERT_EQ(deleted.wait_for(kLongWait), std::future_status::ready);
  const absl::Status status = deleted.get();
  ASSERT_TRUE(status.ok()) << status;
  EXPECT_TRUE(absl::IsNotFound(store_->GetRig("a").status()));
  // Every place of the backlog is free again.
  CreateRig();
  for (int k = 0; k < 4; ++k) Submit(k);
  ASSERT_TRUE(AllScored());
  EXPECT_EQ(store_->ListSegments("a", Page())->items.size(), 4u);
}

TEST_F(DeletionTest, SegmentThatWaitsForItsScoreGivesItsPlaceBack) {
  options_.max_backlog = 2;
  BlockScores();
  CreateRig();
  StartOne();
  for (int k = 0; k < 2; ++k) Submit(k);
  ASSERT_TRUE(AScoreIsUnderWay());
  auto deleted = std::async(std::launch::async, [&] {
    return pipeline_->DeleteSegment("a", {"s", 1}, "eve", "private");
  });
  EXPECT_EQ(deleted.wait_for(std::chrono::milliseconds(100)),
            std::future_status::timeout);
  blocked_ = false;
  ASSERT_EQ(deleted.wait_for(kLongWait), std::future_status::ready);
  EXPECT_TRUE(deleted.get().ok());
  for (int k = 2; k < 5; ++k) Submit(k);
  ASSERT_TRUE(AllScored());
  EXPECT_TRUE(absl::IsNotFound(store_->GetSegment("a", {"s", 1}).status()));
  EXPECT_EQ(store_->ListSegments("a", Page())->items.size(), 4u);
}

// The store's thread reports what it has stored while a change of the same rig,
// which waits for that thread, is under way.
TEST_F(DeletionTest, SegmentsAreChangedWhileOthersAreStored) {
  CreateRig();
  StartOne();
  const std::vector<std::function<absl::Status()>> changes{
      [&] {
        return pipeline_->DeleteSegment("a", {"s", 0}, "eve", "private");
      },
      [&] {
        return pipeline_->QuarantineSegments("a", "s", 2, "eve", "bad")
            .status();
      },
      [&] { return pipeline_->DeleteRig("a", "eve", "sold"); }};
  std::int64_t index = 0;
  for (const auto& change : changes) {
    Submit(index++);
    ASSERT_TRUE(AllScored());
    std::promise<void> store_goes_on;
    store_->BeginTransaction(
        "a",
        1,
        [goes_on = store_goes_on.get_future().share()](UnitOfWork*) {
          goes_on.wait();
          return absl::OkStatus();
        },
        [](const absl::Status&) {});
    std::promise<absl::Status> stored;
    pipeline_->BeginSubmit(
        "a",
        Segment(index++),
        [] { return false; },
        [&](const absl::StatusOr<SubmitResult>& result) {
          stored.set_value(result.status());
        });
    auto changed = std::async(std::launch::async, change);
    EXPECT_EQ(changed.wait_for(std::chrono::milliseconds(100)),
              std::future_status::timeout);
    store_goes_on.set_value();
    ASSERT_EQ(changed.wait_for(kLongWait), std::future_status::ready);
    const absl::Status status = changed.get();
    EXPECT_TRUE(status.ok()) << status;
    const absl::Status kept = stored.get_future().get();
    EXPECT_TRUE(kept.ok()) << kept;
  }
  EXPECT_TRUE(absl::IsNotFound(store_->GetRig("a").status()));
}

TEST_F(DeletionTest, OtherTolerancesScoreWhatIsKeptAnew) {
  CreateRig();
  std::atomic<int> scored = 0;
  estimators_.ends = CoreEstimators().ends;
  estimators_.score =
      [&](const Rig& rig, const Calibration&, const MotionSegment& s) {
        ++scored;
        return FakeInformation(rig, EntropyOf(s.key.index));
      };
  StartOne();
  for (int k = 0; k < 2; ++k) Submit(k);
  ASSERT_TRUE(AllScored());
  ASSERT_EQ(scored, 2);
  const auto update = [&](const std::function<void(StoredRig*)>& change) {
    return pipeline_->UpdateRig(
        "a",
        [&](const StoredRig& before) -> absl::StatusOr<StoredRig> {
          StoredRig after = before;
          change(&after);
          return after;
        },
        "eve",
        "");
  };
  ASSERT_TRUE(update([](StoredRig* rig) { rig->labels["a"] = "b"; }).ok());
  EXPECT_EQ(scored, 2);
  ASSERT_TRUE(update([](StoredRig* rig) {
                rig->rig.prior_sigmas.push_back({"imu.gyro.scale.*", 0.001});
              }).ok());
  EXPECT_EQ(scored, 4);
}

}  // namespace
}  // namespace selfcal::server
