#include <map>
#include <vector>

#include "test/server/store/store_test.h"

namespace selfcal::server {
namespace {

using ::testing::ElementsAre;

using SegmentsTest = StoreTest;
SELFCAL_STORE_TEST_SUITE(SegmentsTest);

TEST_P(SegmentsTest, DataComesBackToTheBitAfterReopening) {
  CreateTestRig("a");
  const MotionSegment segment = Segment(3);
  ASSERT_TRUE(domain_->PutSegment("a", segment).ok());
  Reopen();
  const auto data = store_->GetSegmentData("a", segment.key);
  ASSERT_TRUE(data.ok()) << data.status();
  EXPECT_EQ(data->key, segment.key);
  EXPECT_EQ(data->calibration_version, segment.calibration_version);
  ASSERT_EQ(data->keyframes.size(), segment.keyframes.size());
  for (std::size_t k = 0; k < segment.keyframes.size(); ++k) {
    EXPECT_EQ(data->keyframes[k].t_ns, segment.keyframes[k].t_ns);
    EXPECT_EQ(data->keyframes[k].q_GI.coeffs(),
              segment.keyframes[k].q_GI.coeffs());
    EXPECT_EQ(data->keyframes[k].v_GI, segment.keyframes[k].v_GI);
  }
  ASSERT_EQ(data->imu.size(), segment.imu.size());
  EXPECT_EQ(data->imu.back().accel, segment.imu.back().accel);
  ASSERT_EQ(data->landmarks.size(), segment.landmarks.size());
  EXPECT_EQ(data->landmarks.back().id, segment.landmarks.back().id);
  ASSERT_EQ(data->observations.size(), segment.observations.size());
  EXPECT_EQ(data->observations.back().z_px, segment.observations.back().z_px);
}

TEST_P(SegmentsTest, MetadataTellsWhatWasReceived) {
  CreateTestRig("a");
  const MotionSegment segment = Segment(3);
  ASSERT_TRUE(domain_->PutSegment("a", segment).ok());
  const auto stored = store_->GetSegment("a", segment.key);
  ASSERT_TRUE(stored.ok()) << stored.status();
  EXPECT_EQ(stored->rig, "a");
  EXPECT_EQ(stored->key, segment.key);
  EXPECT_EQ(stored->sequence, 1);
  EXPECT_EQ(stored->state, SegmentState::kStored);
  EXPECT_TRUE(stored->has_data);
  EXPECT_GT(stored->payload_bytes, 0);
  EXPECT_GT(stored->receive_time_ns, 0);
  EXPECT_EQ(stored->start_ns, segment.keyframes.front().t_ns);
  EXPECT_EQ(stored->end_ns, segment.keyframes.back().t_ns);
  EXPECT_EQ(stored->keyframes, static_cast<int>(segment.keyframes.size()));
  EXPECT_EQ(stored->imu_samples, static_cast<int>(segment.imu.size()));
  EXPECT_EQ(stored->landmarks, static_cast<int>(segment.landmarks.size()));
  EXPECT_EQ(stored->observations,
            static_cast<int>(segment.observations.size()));
  EXPECT_FALSE(stored->information.has_value());
  EXPECT_TRUE(stored->tables.empty());
  EXPECT_TRUE(stored->problem.empty());
}

TEST_P(SegmentsTest, TemperatureIsKeptWhereItIsKnown) {
  CreateTestRig("a");
  MotionSegment warm = Segment(0);
  warm.temperature_c = -7.25;
  ASSERT_TRUE(domain_->PutSegment("a", warm).ok());
  ASSERT_TRUE(domain_->PutSegment("a", Segment(1)).ok());
  Reopen();
  EXPECT_EQ(store_->GetSegment("a", warm.key)->temperature_c, -7.25);
  EXPECT_EQ(store_->GetSegmentData("a", warm.key)->temperature_c, -7.25);
  const auto listed = store_->ListSegments("a", {});
  ASSERT_TRUE(listed.ok()) << listed.status();
  EXPECT_EQ(listed->items[0].temperature_c, std::nullopt);
  EXPECT_EQ(listed->items[1].temperature_c, -7.25);
}

TEST_P(SegmentsTest, MotionIsKeptWhenTheDataIsGone) {
  const Rig rig = CreateTestRig("a");
  const MotionStatistics expected = MotionStatisticsOf(Segment(0));
  ASSERT_GT(expected.angular_rate_radps, 0);
  ASSERT_GT(expected.acceleration_mps2, 0);
  Put("a", 0);
  EXPECT_EQ(store_->GetSegment("a", {"s", 0})->motion, expected);
  Score(rig, 0, 1.0, 0.0);
  RenewReserve(rig);
  Reopen();
  EXPECT_FALSE(HasData("a", 0));
  EXPECT_EQ(store_->GetSegment("a", {"s", 0})->motion, expected);
  EXPECT_EQ(store_->ListSegments("a", {})->items.back().motion, expected);
}

TEST_P(SegmentsTest, SameSegmentTwiceChangesNothing) {
  const Rig rig = CreateTestRig("a");
  Put("a", 0);
  const auto again = domain_->PutSegment("a", Segment(0));
  ASSERT_TRUE(again.ok());
  EXPECT_EQ(*again, PutVerdict::kDuplicate);
  Score(rig, 0, 1.0, 0.0);  // enters no table: its data goes
  RenewReserve(rig);
  EXPECT_EQ(*domain_->PutSegment("a", Segment(0)), PutVerdict::kDuplicate);
  EXPECT_FALSE(HasData("a", 0));
  EXPECT_EQ(store_->ListSegments("a", {})->items.size(), 1u + kReserve);
}

TEST_P(SegmentsTest, KeysAreApartByRigAndSession) {
  CreateTestRig("a");
  CreateTestRig("b");
  EXPECT_EQ(*domain_->PutSegment("a", Segment(0, "s")), PutVerdict::kStored);
  EXPECT_EQ(*domain_->PutSegment("a", Segment(0, "t")), PutVerdict::kStored);
  EXPECT_EQ(*domain_->PutSegment("b", Segment(0, "s")), PutVerdict::kStored);
  EXPECT_EQ(store_->GetSegment("a", {"t", 0})->sequence, 2);
  EXPECT_EQ(store_->GetSegment("b", {"s", 0})->sequence, 1);
  EXPECT_TRUE(absl::IsNotFound(store_->GetSegment("b", {"t", 0}).status()));
}

TEST_P(SegmentsTest, UnscoredOfARigAreListedInTheOrderOfArrival) {
  const Rig a = CreateTestRig("a");
  CreateTestRig("b");
  Put("a", 5);
  Put("b", 1);
  Put("a", 2);
  Put("b", 0);
  Score(a, 5, 1.0);
  Reopen();
  const auto unscored = store_->ListUnscored(100);
  ASSERT_TRUE(unscored.ok());
  ASSERT_EQ(unscored->size(), 3u);
  std::map<std::string, std::vector<std::int64_t>> indices;
  for (const auto& segment : *unscored) {
    indices[segment.rig].push_back(segment.key.index);
  }
  EXPECT_THAT(indices["a"], ElementsAre(2));
  EXPECT_THAT(indices["b"], ElementsAre(1, 0));
}

TEST_P(SegmentsTest, TheOldestUnscoredOfEachRigAreListed) {
  for (const char* rig : {"a", "b", "c"}) CreateTestRig(rig);
  for (const int index : {4, 1, 3}) Put("a", index);
  Put("c", 7);
  const auto unscored = store_->ListUnscored(2);
  ASSERT_TRUE(unscored.ok()) << unscored.status();
  std::map<std::string, std::vector<std::int64_t>> indices;
  for (const auto& segment : *unscored) {
    indices[segment.rig].push_back(segment.key.index);
  }
  EXPECT_EQ(indices,
            (std::map<std::string, std::vector<std::int64_t>>{{"a", {4, 1}},
                                                              {"c", {7}}}));
}

// The next segment takes the number of the newest one.
TEST_P(SegmentsTest, ARivalThatIsDeletedIsNotMistakenForTheNextSegment) {
  Rig rig = TestRig("a");
  rig.table_size = 1;
  ASSERT_TRUE(domain_->CreateRig(rig).ok());
  Put("a", 0);
  Score(rig, 0, -10);
  Put("a", 1);
  Score(rig, 1, -20);
  const auto before = store_->ListExclusions("a", {"s", 0});
  ASSERT_TRUE(before.ok() && !before->empty()) << before.status();
  EXPECT_EQ(before->front().rival, (SegmentKey{"s", 1}));
  ASSERT_TRUE(domain_->DeleteSegment("a", {"s", 1}, "eve", "private").ok());
  Put("a", 2);
  EXPECT_EQ(store_->GetSegment("a", {"s", 2})->sequence, 2);
  const auto after = store_->ListExclusions("a", {"s", 0});
  ASSERT_TRUE(after.ok() && !after->empty()) << after.status();
  EXPECT_EQ(after->front().cause, ExclusionCause::kReplaced);
  EXPECT_FALSE(after->front().rival);
}

// Both numbers are taken again, though only one was the newest's.
TEST_P(SegmentsTest, ARivalThatIsDeletedBeforeTheNewestIsForgottenWithIt) {
  Rig rig = TestRig("a");
  rig.table_size = 1;
  ASSERT_TRUE(domain_->CreateRig(rig).ok());
  for (const std::int64_t index : {0, 1}) {
    Put("a", index);
    Score(rig, index, -10.0 * static_cast<double>(index));
  }
  Put("a", 2);
  const auto before = store_->ListExclusions("a", {"s", 0});
  ASSERT_TRUE(before.ok() && !before->empty()) << before.status();
  EXPECT_EQ(before->front().rival, (SegmentKey{"s", 1}));
  for (const std::int64_t index : {1, 2}) {
    ASSERT_TRUE(
        domain_->DeleteSegment("a", {"s", index}, "eve", "private").ok());
  }
  Put("a", 3);
  EXPECT_EQ(store_->GetSegment("a", {"s", 3})->sequence, 2);
  const auto after = store_->ListExclusions("a", {"s", 0});
  ASSERT_TRUE(after.ok() && !after->empty()) << after.status();
  EXPECT_FALSE(after->front().rival);
}

TEST_P(SegmentsTest, PagesShowEverySegmentOnceNewestFirst) {
  CreateTestRig("a");
  for (int k = 0; k < 7; ++k) Put("a", k);
  std::vector<std::int64_t> sequences;
  Page page{3, ""};
  int pages = 0;
  do {
    const auto listed = store_->ListSegments("a", page);
    ASSERT_TRUE(listed.ok()) << listed.status();
    for (const StoredSegment& item : listed->items) {
      sequences.push_back(item.sequence);
    }
    page.token = listed->next_token;
    ++pages;
  } while (!page.token.empty());
  EXPECT_EQ(pages, 3);
  EXPECT_THAT(sequences, ::testing::ElementsAre(7, 6, 5, 4, 3, 2, 1));
}

TEST_P(SegmentsTest, APageThatEndsTheListHasNoToken) {
  CreateTestRig("a");
  for (int k = 0; k < 4; ++k) Put("a", k);
  EXPECT_TRUE(store_->ListSegments("a", {4, ""})->next_token.empty());
}

TEST_P(SegmentsTest, TokensOfOtherListsAreRefused) {
  CreateTestRig("a");
  CreateTestRig("b");
  Put("a", 0);
  Put("a", 1);
  const std::string token = store_->ListSegments("a", {1, ""})->next_token;
  ASSERT_FALSE(token.empty());
  EXPECT_TRUE(
      absl::IsInvalidArgument(store_->ListSegments("b", {1, token}).status()));
  EXPECT_TRUE(absl::IsInvalidArgument(
      store_->ListCalibrations("a", {1, token}).status()));
  for (const char* bad : {"x", "zz", "00", "12345", "\xff\xff"}) {
    EXPECT_TRUE(
        absl::IsInvalidArgument(store_->ListSegments("a", {1, bad}).status()))
        << bad;
    EXPECT_TRUE(absl::IsInvalidArgument(store_->ListRigs({1, bad}).status()));
    EXPECT_TRUE(absl::IsInvalidArgument(store_->ListEvents({1, bad}).status()));
  }
  EXPECT_TRUE(absl::IsInvalidArgument(
      store_->ListSegments("a", {1, token + "61"}).status()));
}

TEST_P(SegmentsTest, UnusableLeavesQueueAndTablesAndSaysWhy) {
  const Rig rig = CreateTestRig("a");
  Put("a", 0);
  Put("a", 1);
  Score(rig, 1, 1.0);
  ASSERT_TRUE(domain_->MarkUnusable("a", {"s", 0}, "bit rot").ok());
  ASSERT_TRUE(domain_->MarkUnusable("a", {"s", 1}, "more of it").ok());
  EXPECT_TRUE(store_->ListUnscored(10)->empty());
  EXPECT_TRUE(TableIndices("a", 0).empty());
  EXPECT_FALSE(HasData("a", 0));
  EXPECT_FALSE(HasData("a", 1));
  const auto segment = store_->GetSegment("a", {"s", 0});
  EXPECT_EQ(segment->state, SegmentState::kUnusable);
  EXPECT_EQ(segment->problem, "bit rot");
  EXPECT_EQ(store_->ListEvents({})->items.back().kind,
            EventKind::kSegmentUnusable);
  EXPECT_TRUE(absl::IsFailedPrecondition(
      domain_->CommitScore("a", {"s", 0}, FakeInformation(rig, 1)).status()));
}

}  // namespace
}  // namespace selfcal::server
