// What an operator deletes: all of it or nothing, and an event remains.
#include "server/store/maintenance.h"
#include "test/server/store/store_test.h"
#include "test/server/test_records.h"

namespace selfcal::server {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

class DeletionTest : public StoreTest {
 protected:
  // A rig with two tables entries, a version computed from them, and segment 2
  // that it did not use.
  void FillRig(const std::string& id) {
    rig_ = TestRig(id);
    rig_.table_size = 2;
    ASSERT_TRUE(domain_->CreateRig(rig_).ok());
    for (int k = 0; k < 2; ++k) {
      Put(id, k);
      Score(rig_, k, -10 - k);
    }
    const auto run = domain_->CreateManualRun(id, true);
    const std::int64_t number = run.ok() ? run->run : 1;
    ASSERT_TRUE(domain_->BeginRun(id, number).ok());
    const auto finished = domain_->FinishRun(
        id, number, TestCalibration(rig_, *store_->GetRun(id, number)));
    ASSERT_TRUE(finished.ok()) << finished.status();
    Put(id, 2);
    Score(rig_, 2, -1);
  }

  StoredEvent NewestEvent(const std::string& rig) {
    const auto events = store_->ListNewestEvents({1, ""}, rig);
    EXPECT_TRUE(events.ok() && !events->items.empty());
    return events.ok() && !events->items.empty() ? events->items[0]
                                                 : StoredEvent();
  }

  Rig rig_;
};

SELFCAL_STORE_TEST_SUITE(DeletionTest);

TEST_P(DeletionTest, DeletedSegmentIsGoneAndAnEventRemains) {
  FillRig("a");
  const auto waiting = domain_->DeleteSegment("a", {"s", 2}, "eve", "private");
  ASSERT_TRUE(waiting.ok()) << waiting.status();
  EXPECT_FALSE(*waiting);
  EXPECT_TRUE(absl::IsNotFound(store_->GetSegment("a", {"s", 2}).status()));
  EXPECT_TRUE(absl::IsNotFound(store_->GetSegmentData("a", {"s", 2}).status()));
  EXPECT_THAT(store_->ListSegments("a", Page())->items, SizeIs(2));
  const StoredEvent event = NewestEvent("a");
  EXPECT_EQ(event.kind, EventKind::kSegmentDeleted);
  EXPECT_THAT(event.detail, HasSubstr("by eve: private"));
  EXPECT_TRUE(absl::IsNotFound(
      domain_->DeleteSegment("a", {"s", 2}, "eve", "again").status()));
}

TEST_P(DeletionTest, SegmentThatWaitsForItsScoreIsToldApart) {
  FillRig("a");
  Put("a", 3);
  const auto waiting = domain_->DeleteSegment("a", {"s", 3}, "eve", "private");
  ASSERT_TRUE(waiting.ok()) << waiting.status();
  EXPECT_TRUE(*waiting);
}

TEST_P(DeletionTest, SegmentInATableLeavesIt) {
  rig_ = TestRig("a");
  ASSERT_TRUE(domain_->CreateRig(rig_).ok());
  Put("a", 0);
  Score(rig_, 0, -10);
  ASSERT_THAT((*store_->GetTables("a"))[0].entries, SizeIs(1));
  ASSERT_TRUE(domain_->DeleteSegment("a", {"s", 0}, "eve", "private").ok());
  EXPECT_THAT((*store_->GetTables("a"))[0].entries, IsEmpty());
}

TEST_P(DeletionTest, OriginOfAVersionAndOfARunStays) {
  FillRig("a");
  const auto of_version =
      domain_->DeleteSegment("a", {"s", 0}, "eve", "private").status();
  EXPECT_TRUE(absl::IsFailedPrecondition(of_version));
  EXPECT_THAT(std::string(of_version.message()), HasSubstr("version 2"));
  EXPECT_TRUE(store_->GetSegmentData("a", {"s", 0}).ok());
  const auto run = domain_->CreateManualRun("a", true);
  ASSERT_TRUE(run.ok()) << run.status();
  const auto of_run =
      domain_->DeleteSegment("a", {"s", 1}, "eve", "private").status();
  EXPECT_TRUE(absl::IsFailedPrecondition(of_run));
  EXPECT_THAT(std::string(of_run.message()), HasSubstr("run "));
}

TEST_P(DeletionTest, DeletedRigLeavesItsEventsAndOtherRigsAlone) {
  FillRig("other");
  FillRig("a");
  Put("a", 3);
  const auto before = store_->ListSegments("other", Page())->items.size();
  const auto waiting = domain_->DeleteRig("a", "eve", "sold");
  ASSERT_TRUE(waiting.ok()) << waiting.status();
  EXPECT_EQ(*waiting, 1);
  EXPECT_TRUE(absl::IsNotFound(store_->GetRig("a").status()));
  EXPECT_TRUE(absl::IsNotFound(store_->GetActiveCalibration("a").status()));
  EXPECT_EQ(NewestEvent("a").kind, EventKind::kRigDeleted);
  EXPECT_THAT(NewestEvent("a").detail, HasSubstr("by eve: sold"));
  EXPECT_EQ(store_->ListSegments("other", Page())->items.size(), before);
  EXPECT_EQ(store_->GetActiveCalibration("other")->version, 2);
  int problems = 0;
  const auto checked = store_->maintenance()->Check([&](const auto& problem) {
    ADD_FAILURE() << problem.place << ": " << problem.description;
    ++problems;
    return true;
  });
  EXPECT_TRUE(checked.ok()) << checked.status();
  EXPECT_EQ(problems, 0);
}

TEST_P(DeletionTest, NameOfADeletedRigCanBeUsedAgain) {
  FillRig("a");
  ASSERT_TRUE(domain_->DeleteRig("a", "eve", "sold").ok());
  FillRig("a");
  EXPECT_EQ(store_->GetActiveCalibration("a")->version, 2);
  EXPECT_THAT(store_->ListSegments("a", Page())->items, SizeIs(3));
}

TEST_P(DeletionTest, RigWithAnUnfinishedRunStays) {
  FillRig("a");
  const auto run = domain_->CreateManualRun("a", true);
  ASSERT_TRUE(run.ok()) << run.status();
  const auto refused = domain_->DeleteRig("a", "eve", "sold").status();
  EXPECT_TRUE(absl::IsFailedPrecondition(refused));
  EXPECT_THAT(store_->ListSegments("a", Page())->items, SizeIs(3));
  ASSERT_TRUE(
      domain_->EndRun("a", run->run, RunState::kCancelled, "by hand").ok());
  EXPECT_TRUE(domain_->DeleteRig("a", "eve", "sold").ok());
}

}  // namespace
}  // namespace selfcal::server
