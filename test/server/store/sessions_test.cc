// Sessions, and the way of the device in each, which stay when data goes.
#include <cmath>
#include <limits>

#include "server/store/segment_rows.h"
#include "test/server/store/store_test.h"

namespace selfcal::server {
namespace {

using ::testing::ElementsAre;

class SessionsTest : public StoreTest {
 protected:
  void PutIn(const std::string& session, std::int64_t index) {
    const auto verdict = domain_->PutSegment("a", Segment(index, session));
    ASSERT_TRUE(verdict.ok()) << verdict.status();
  }

  std::vector<SessionSegment> All(const std::string& session, int page_size) {
    std::vector<SessionSegment> all;
    Page page{page_size, ""};
    do {
      const auto listed = store_->ListSessionSegments("a", session, page);
      EXPECT_TRUE(listed.ok()) << listed.status();
      if (!listed.ok()) return all;
      EXPECT_LE(static_cast<int>(listed->items.size()), page_size);
      all.insert(all.end(), listed->items.begin(), listed->items.end());
      page.token = listed->next_token;
    } while (!page.token.empty());
    return all;
  }
};
SELFCAL_STORE_TEST_SUITE(SessionsTest);

TEST_P(SessionsTest, AreListedByNameWithTheirSegments) {
  CreateTestRig("a");
  CreateTestRig("b");
  PutIn("walk", 0);
  PutIn("walk", 1);
  PutIn("climb", 7);
  PutIn("run", 0);
  const auto first = store_->ListSessions("a", {2, ""});
  ASSERT_TRUE(first.ok()) << first.status();
  ASSERT_EQ(first->items.size(), 2u);
  EXPECT_EQ(first->items[0].session, "climb");
  EXPECT_EQ(first->items[0].segments, 1);
  EXPECT_EQ(first->items[1].session, "run");
  const auto rest = store_->ListSessions("a", {2, first->next_token});
  ASSERT_TRUE(rest.ok()) << rest.status();
  ASSERT_EQ(rest->items.size(), 1u);
  EXPECT_EQ(rest->items[0].session, "walk");
  EXPECT_EQ(rest->items[0].segments, 2);
  EXPECT_GT(rest->items[0].last_receive_ns, rest->items[0].first_receive_ns);
  EXPECT_TRUE(rest->next_token.empty());
  EXPECT_TRUE(store_->ListSessions("b", {})->items.empty());
  EXPECT_EQ(store_->GetSession("a", "walk")->segments, 2);
}

TEST_P(SessionsTest, WhatIsNotThereIsSaid) {
  CreateTestRig("a");
  PutIn("walk", 0);
  PutIn("walk", 1);
  PutIn("run", 0);
  EXPECT_TRUE(absl::IsNotFound(store_->ListSessions("none", {}).status()));
  EXPECT_TRUE(absl::IsNotFound(store_->GetSession("a", "none").status()));
  EXPECT_TRUE(
      absl::IsNotFound(store_->ListSessionSegments("a", "none", {}).status()));
  const auto token = store_->ListSessionSegments("a", "walk", {1, ""});
  ASSERT_TRUE(token.ok());
  EXPECT_TRUE(absl::IsInvalidArgument(
      store_->ListSessionSegments("a", "run", {1, token->next_token})
          .status()));
  EXPECT_TRUE(absl::IsInvalidArgument(
      store_->ListSessions("a", {1, "nonsense"}).status()));
}

TEST_P(SessionsTest, SegmentsComeInTheOrderOfTheirIndexWithScoresAndTables) {
  const Rig rig = CreateTestRig("a");
  for (const int index : {2, 0, 10, 1}) Put("a", index);
  Score(rig, 0, 3.0);
  Score(rig, 2, 1.0, 0.0);  // gains too little
  Reopen();
  const auto all = All("s", 3);
  ASSERT_EQ(all.size(), 4u);
  std::vector<std::int64_t> indices;
  for (const auto& segment : all) indices.push_back(segment.key.index);
  EXPECT_THAT(indices, ElementsAre(0, 1, 2, 10));
  EXPECT_EQ(all[0].state, SegmentState::kScored);
  EXPECT_TRUE(all[0].has_data);
  EXPECT_EQ(all[0].tables.size(), rig.groups.size());
  ASSERT_EQ(all[0].scores.size(), rig.groups.size());
  EXPECT_EQ(all[0].scores[0].entropy, 3.0);
  EXPECT_EQ(all[1].state, SegmentState::kStored);
  EXPECT_TRUE(all[1].scores.empty());
  EXPECT_TRUE(all[2].has_data) << "of the reserve";
  EXPECT_TRUE(all[2].tables.empty());
  EXPECT_EQ(all[2].scores[0].gain, 0.0);
}

TEST_P(SessionsTest, ThePathStaysWhenTheDataGoes) {
  const Rig rig = CreateTestRig("a");
  Put("a", 0);
  Score(rig, 0, -1.0, 0.0);
  RenewReserve(rig);
  ASSERT_FALSE(HasData("a", 0));
  Reopen();
  const MotionSegment segment = Segment(0);
  const auto all = All("s", 10);
  ASSERT_EQ(all.size(), 1u + kReserve);
  ASSERT_EQ(all[0].path.size(), segment.keyframes.size()) << "all of 8";
  EXPECT_EQ(all[0].start_ns, segment.keyframes.front().t_ns);
  for (std::size_t k = 0; k < segment.keyframes.size(); ++k) {
    const KeyframeState& state = segment.keyframes[k];
    EXPECT_EQ(all[0].path[k].p_GI, state.p_GI.cast<float>());
    EXPECT_NEAR(all[0].path[k].seconds,
                static_cast<double>(state.t_ns - all[0].start_ns) * 1e-9,
                1e-6);
  }
}

TEST_P(SessionsTest, APathHasSixteenPointsOfALongSegment) {
  CreateTestRig("a");
  MotionSegment segment = Segment(0);
  const KeyframeState first = segment.keyframes.front();
  segment.observations.clear();
  segment.landmarks.clear();
  segment.keyframes.clear();
  const std::int64_t end_ns = segment.imu.back().t_ns;
  constexpr int kKeyframes = 40;
  for (int k = 0; k < kKeyframes; ++k) {
    KeyframeState state = first;
    state.t_ns += k * ((end_ns - first.t_ns) / (kKeyframes - 1));
    state.p_GI.x() = k;
    segment.keyframes.push_back(state);
  }
  ASSERT_TRUE(domain_->PutSegment("a", segment).ok());
  const auto all = All("s", 10);
  ASSERT_EQ(all.size(), 1u);
  ASSERT_EQ(static_cast<int>(all[0].path.size()), kMaxPathPoints);
  EXPECT_EQ(all[0].path.front().p_GI.x(), 0.0F);
  EXPECT_EQ(all[0].path.back().p_GI.x(), static_cast<float>(kKeyframes - 1));
  for (int k = 1; k < kMaxPathPoints; ++k) {
    const float step = all[0].path[k].p_GI.x() - all[0].path[k - 1].p_GI.x();
    EXPECT_GE(step, 2.0F);
    EXPECT_LE(step, 3.0F);
  }
}

TEST_P(SessionsTest, AScoreThatIsNotANumberIsListed) {
  const Rig rig = CreateTestRig("a");
  Put("a", 0);
  Score(rig, 0, std::numeric_limits<double>::quiet_NaN());
  const auto all = All("s", 10);
  ASSERT_EQ(all.size(), 1u);
  EXPECT_TRUE(std::isnan(all[0].scores[0].entropy));
}

// --- Why a table does not hold a segment.

TEST_P(SessionsTest, ASegmentInATableHasNoExclusion) {
  const Rig rig = CreateTestRig("a");
  Put("a", 0);
  EXPECT_TRUE(store_->ListExclusions("a", {"s", 0})->empty());
  Score(rig, 0, 1.0);
  EXPECT_TRUE(store_->ListExclusions("a", {"s", 0})->empty());
  EXPECT_TRUE(absl::IsNotFound(store_->ListExclusions("a", {"s", 9}).status()));
}

TEST_P(SessionsTest, ASegmentThatWasPushedOutNamesWhatCameInstead) {
  const Rig rig = CreateTestRig("a");  // tables of 2
  for (int k = 0; k < 4; ++k) Put("a", k);
  Score(rig, 0, 3.0);
  Score(rig, 1, 1.0);
  Score(rig, 2, 2.0);  // instead of 0
  Score(rig, 3, 2.5);  // never enters
  Reopen();
  const auto pushed = store_->ListExclusions("a", {"s", 0});
  ASSERT_TRUE(pushed.ok()) << pushed.status();
  ASSERT_EQ(pushed->size(), rig.groups.size());
  for (std::size_t g = 0; g < pushed->size(); ++g) {
    const Exclusion& exclusion = (*pushed)[g];
    EXPECT_EQ(exclusion.group, rig.groups[g].name);
    EXPECT_EQ(exclusion.cause, ExclusionCause::kReplaced);
    EXPECT_GT(exclusion.time_ns, 0);
    EXPECT_EQ(exclusion.rival, (SegmentKey{"s", 2}));
    EXPECT_EQ(exclusion.rival_entropy, 2.0);
  }
  const auto refused = store_->ListExclusions("a", {"s", 3});
  ASSERT_EQ(refused->size(), rig.groups.size());
  EXPECT_EQ(refused->front().cause, ExclusionCause::kOutranked);
  EXPECT_EQ(refused->front().rival, (SegmentKey{"s", 2}));
  EXPECT_EQ(refused->front().rival_entropy, 2.0);
}

TEST_P(SessionsTest, ASegmentOfInsufficientGainHasNoRival) {
  const Rig rig = CreateTestRig("a");
  Put("a", 0);
  Score(rig, 0, 1.0, rig.min_gain_nats / 2);
  const auto exclusions = store_->ListExclusions("a", {"s", 0});
  ASSERT_EQ(exclusions->size(), rig.groups.size());
  EXPECT_EQ(exclusions->front().cause, ExclusionCause::kInsufficientGain);
  EXPECT_FALSE(exclusions->front().rival);
  EXPECT_FALSE(exclusions->front().rival_entropy);
}

TEST_P(SessionsTest, ASegmentThatBecameTooOldSaysSo) {
  RigPolicy policy;
  policy.table_max_age_ns = 1;
  const Rig rig = TestRig("a");
  ASSERT_TRUE(domain_->CreateRig(rig, policy).ok());
  Put("a", 0);
  Score(rig, 0, 1.0);
  Put("a", 1);
  Score(rig, 1, 2.0);
  const auto exclusions = store_->ListExclusions("a", {"s", 0});
  ASSERT_EQ(exclusions->size(), rig.groups.size());
  EXPECT_EQ(exclusions->front().cause, ExclusionCause::kTooOld);
}

TEST_P(SessionsTest, AQuarantinedSegmentIsExcludedAsUnusable) {
  const Rig rig = CreateTestRig("a");
  Put("a", 0);
  Score(rig, 0, 1.0);
  ASSERT_TRUE(domain_->MarkUnusable("a", {"s", 0}, "broken").ok());
  const auto exclusions = store_->ListExclusions("a", {"s", 0});
  ASSERT_EQ(exclusions->size(), rig.groups.size());
  EXPECT_EQ(exclusions->front().cause, ExclusionCause::kUnusable);
}

// The records of a segment as they are when its data is gone.
absl::Status InsertScored(UnitOfWork* tx,
                          const NewSegment& segment,
                          const SegmentInformation& information) {
  const auto sequence = InsertSegment(tx, segment);
  if (!sequence.ok()) return sequence.status();
  const absl::Status scored =
      WriteScore(tx, {.key = segment.key, .sequence = *sequence}, information);
  return scored.ok() ? DeleteData(tx, *sequence) : scored;
}

TEST_P(SessionsTest, TenThousandSegmentsComeInTenPages) {
  constexpr int kSegments = 10'000;
  const Rig rig = CreateTestRig("a");
  auto packed = PackNewSegment(Segment(0));
  ASSERT_TRUE(packed.ok()) << packed.status();
  SegmentInformation information = FakeInformation(rig, 1);
  information.Lambda.resize(0, 0);
  information.eta.resize(0);
  const absl::Status written = store_->Transact("a", 1, [&](UnitOfWork* tx) {
    for (packed->key.index = 0; packed->key.index < kSegments;
         ++packed->key.index) {
      const absl::Status inserted = InsertScored(tx, *packed, information);
      if (!inserted.ok()) return inserted;
    }
    return absl::OkStatus();
  });
  ASSERT_TRUE(written.ok()) << written;
  EXPECT_EQ(store_->GetSession("a", "s")->segments, kSegments);
  Page page{5000, ""};  // more than a page may have
  int pages = 0;
  std::int64_t next = 0;
  do {
    const auto listed = store_->ListSessionSegments("a", "s", page);
    ASSERT_TRUE(listed.ok()) << listed.status();
    ++pages;
    EXPECT_EQ(listed->items.size(), 1000u);
    for (const SessionSegment& segment : listed->items) {
      ASSERT_EQ(segment.key.index, next++);
      ASSERT_EQ(segment.path.size(), 8u);
      ASSERT_EQ(segment.scores.size(), rig.groups.size());
    }
    page.token = listed->next_token;
  } while (!page.token.empty());
  EXPECT_EQ(pages, 10);
  EXPECT_EQ(next, kSegments);
}

}  // namespace
}  // namespace selfcal::server
