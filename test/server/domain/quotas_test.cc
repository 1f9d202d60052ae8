// What the operator limits: whatever goes says so, what is needed stays, and
// where nothing may go a segment is refused.
#include "server/domain/quotas.h"

#include "test/server/store/store_test.h"

namespace selfcal::server {
namespace {

using ::testing::HasSubstr;

class QuotasTest : public StoreTest {
 protected:
  // Tables of two segments in each of their groups.
  void OpenWith(const Quotas& quotas) {
    Reopen({.quotas = quotas});
    if (!store_->GetRig("a").ok()) {
      ASSERT_TRUE(domain_->CreateRig(rig_).ok());
    }
  }

  absl::Status Put(int index) {
    return domain_->PutSegment("a", Segment(index)).status();
  }
  void PutAndScore(int index, double entropy, double gain) {
    ASSERT_TRUE(Put(index).ok());
    ASSERT_TRUE(domain_
                    ->CommitScore("a",
                                  {"s", index},
                                  FakeInformation(rig_, entropy, gain, index))
                    .ok());
  }
  // Ends the run that full tables start.
  void EndRun(std::int64_t run) {
    ASSERT_TRUE(domain_->EndRun("a", run, RunState::kCancelled, "").ok());
  }
  bool HasData(int index) {
    return store_->GetSegmentData("a", {"s", index}).ok();
  }
  std::int64_t SegmentBytes() {
    OpenWith({});
    EXPECT_TRUE(Put(1000).ok());
    return store_->GetSegment("a", {"s", 1000})->payload_bytes;
  }
  std::vector<std::string> Evictions() {
    std::vector<std::string> details;
    const auto listed = store_->ListEvents({1000, ""}, "a");
    for (const StoredEvent& event : listed->items) {
      if (event.kind == EventKind::kDataEvicted)
        details.push_back(event.detail);
    }
    return details;
  }

  const Rig rig_ = TestRig("a");
};
SELFCAL_STORE_TEST_SUITE(QuotasTest);

TEST_P(QuotasTest, TheLeastInformativeDataGoesAndSaysWhy) {
  const std::int64_t bytes = SegmentBytes();
  ASSERT_TRUE(domain_->MarkUnusable("a", {"s", 1000}, "not needed").ok());
  OpenWith({.max_payload_bytes_per_rig = 2 * bytes + bytes / 2});
  PutAndScore(0, /*entropy=*/2, /*gain=*/5);
  PutAndScore(1, /*entropy=*/1, /*gain=*/9);
  EndRun(1);
  ASSERT_TRUE(Put(2).ok());
  EXPECT_FALSE(HasData(0));
  EXPECT_TRUE(HasData(1));
  EXPECT_TRUE(HasData(2));
  const auto evicted = store_->GetSegment("a", {"s", 0});
  EXPECT_EQ(evicted->state, SegmentState::kScored);
  EXPECT_TRUE(evicted->information.has_value());
  EXPECT_TRUE(evicted->tables.empty());
  EXPECT_THAT(evicted->problem, HasSubstr("evicted"));
  EXPECT_THAT(
      std::string(store_->GetSegmentData("a", {"s", 0}).status().message()),
      HasSubstr("evicted"));
  ASSERT_EQ(Evictions().size(), 1u);
  EXPECT_THAT(Evictions()[0], HasSubstr("s~0"));
  const auto tables = store_->GetTables("a");
  for (const Table& table : *tables) {
    ASSERT_EQ(table.entries.size(), 1u);
    EXPECT_EQ(table.entries[0].key.index, 1);
  }
  const auto exclusions = store_->ListExclusions("a", {"s", 0});
  ASSERT_EQ(exclusions->size(), rig_.groups.size());
  EXPECT_EQ(exclusions->front().cause, ExclusionCause::kDataEvicted);
}

TEST_P(QuotasTest, WhatWaitsForItsScoreIsNeverEvicted) {
  const std::int64_t bytes = SegmentBytes();
  OpenWith({.max_payload_bytes_per_rig = 3 * bytes + bytes / 2});
  ASSERT_TRUE(Put(0).ok());
  ASSERT_TRUE(Put(1).ok());
  const absl::Status refused = Put(2);
  EXPECT_TRUE(absl::IsResourceExhausted(refused)) << refused;
  EXPECT_THAT(std::string(refused.message()),
              HasSubstr("max-payload-bytes-per-rig"));
  EXPECT_TRUE(HasData(0));
  EXPECT_TRUE(HasData(1));
  EXPECT_TRUE(Evictions().empty());
  EXPECT_FALSE(store_->GetSegment("a", {"s", 2}).ok());
  // Room comes with the scores.
  ASSERT_TRUE(domain_->MarkUnusable("a", {"s", 0}, "").ok());
  EXPECT_TRUE(Put(2).ok());
}

TEST_P(QuotasTest, WhatAnUnfinishedRunNeedsIsNeverEvicted) {
  const std::int64_t bytes = SegmentBytes();
  ASSERT_TRUE(domain_->MarkUnusable("a", {"s", 1000}, "").ok());
  OpenWith({.max_payload_bytes_per_rig = 2 * bytes + bytes / 2});
  PutAndScore(0, 2, 5);
  PutAndScore(1, 1, 9);
  ASSERT_EQ(store_->ListUnfinishedRuns()->size(), 1u);
  EXPECT_TRUE(absl::IsResourceExhausted(Put(2)));
  EXPECT_TRUE(HasData(0));
  EndRun(1);
  EXPECT_TRUE(Put(2).ok());
}

TEST_P(QuotasTest, OneRigDoesNotTakeFromAnother) {
  const std::int64_t bytes = SegmentBytes();
  OpenWith({.max_payload_bytes_per_rig = bytes + bytes / 2});
  ASSERT_TRUE(domain_->CreateRig(TestRig("b")).ok());
  EXPECT_TRUE(absl::IsResourceExhausted(Put(1)));
  EXPECT_TRUE(domain_->PutSegment("b", Segment(1)).ok());
}

TEST_P(QuotasTest, ADuplicateNeedsNoRoom) {
  const std::int64_t bytes = SegmentBytes();
  OpenWith({.max_payload_bytes_per_rig = bytes});
  EXPECT_EQ(*domain_->PutSegment("a", Segment(1000)), PutVerdict::kDuplicate);
}

TEST_P(QuotasTest, OldMetadataGoesButNotWhatACalibrationCameFrom) {
  OpenWith({});
  PutAndScore(0, 2, 5);
  PutAndScore(1, 1, 9);
  const auto run = domain_->BeginRun("a", 1);
  ASSERT_TRUE(run.ok());
  const auto size = TangentSize(rig_.factory);
  StoredCalibration calibration;
  calibration.rig = "a";
  calibration.theta = rig_.factory;
  calibration.covariance = Eigen::MatrixXd::Identity(size, size);
  calibration.run = 1;
  calibration.base_version = 1;
  calibration.segments = run->segments;
  calibration.report = CalibrationResult();
  calibration.report->theta = rig_.factory;
  calibration.report->covariance = calibration.covariance;
  ASSERT_TRUE(domain_->FinishRun("a", 1, calibration).ok());
  for (int k = 2; k < 8; ++k) PutAndScore(k, 50, 0);  // enter no table
  OpenWith({.max_segments_per_rig = 3});
  ASSERT_TRUE(Put(8).ok());
  std::vector<std::int64_t> left;
  const auto listed = store_->ListSegments("a", {});
  for (const auto& segment : listed->items) {
    left.push_back(segment.key.index);
  }
  EXPECT_THAT(left, ::testing::ElementsAre(8, 7, 6, 5, 1, 0));
  ASSERT_EQ(Evictions().size(), 1u);
  EXPECT_THAT(Evictions()[0], HasSubstr("3 segments"));
  EXPECT_EQ(store_->GetSegment("a", {"s", 8})->sequence, 9);
  EXPECT_EQ(store_->GetSession("a", "s")->segments, 6) << "paths go along";
  EXPECT_EQ(store_->GetCalibration("a", 2)->segments.size(), 2u);
}

// One event for several: those of single segments would fill the database that
// the quota keeps small.
TEST_P(QuotasTest, MetadataBeyondALargeQuotaGoesATenthAtATime) {
  OpenWith({.max_segments_per_rig = 30});
  for (int k = 0; k < 60; ++k) {
    PutAndScore(k, 50, 0);  // enters no table
    const auto kept = store_->ListSegments("a", {})->items.size();
    EXPECT_LE(kept, 30u + 3u);
    EXPECT_GE(kept, std::min(k + 1u, 30u));
  }
  EXPECT_EQ(Evictions().size(), 9u);
  EXPECT_THAT(Evictions()[0], HasSubstr("3 segments"));
}

TEST_P(QuotasTest, MetadataOlderThanItMayBeGoes) {
  OpenWith({});
  const std::int64_t now_ns = NowNs();
  for (int k = 0; k < 4; ++k) {
    now_ns_ = k < 2 ? now_ns - 7200 * 1'000'000'000LL : now_ns;
    PutAndScore(k, 50, 0);  // enters no table
  }
  OpenWith({.max_segment_age_s = 3600});
  ASSERT_TRUE(Put(4).ok());
  EXPECT_TRUE(absl::IsNotFound(store_->GetSegment("a", {"s", 1}).status()));
  EXPECT_TRUE(store_->GetSegment("a", {"s", 2}).ok());
  ASSERT_EQ(Evictions().size(), 1u);
  EXPECT_THAT(Evictions()[0], HasSubstr("2 segments"));
}

TEST_P(QuotasTest, AFullDatabaseRefusesSegmentsAndStillScoresWhatItHas) {
  if (!GetParam().limits_size) GTEST_SKIP() << "the engine has no such limit";
  OpenWith({.max_database_bytes = 2'000'000});
  absl::Status refused;
  int stored = 0;
  for (; stored < 1000 && refused.ok(); ++stored) refused = Put(stored);
  EXPECT_TRUE(absl::IsResourceExhausted(refused)) << refused;
  EXPECT_THAT(std::string(refused.message()), HasSubstr("max-database-bytes"));
  --stored;
  ASSERT_GT(stored, 2);
  for (int k = 0; k < stored; ++k) {
    EXPECT_TRUE(
        domain_
            ->CommitScore("a", {"s", k}, FakeInformation(rig_, 1.0 + k, 5, k))
            .ok());
  }
  // The data of those in no table is gone: there is room again.
  EXPECT_TRUE(Put(stored).ok());
}

}  // namespace
}  // namespace selfcal::server
