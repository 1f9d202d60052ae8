#include "server/store/segment_ends.h"

#include <map>

#include "test/server/store/fake_ends.h"
#include "test/server/store/store_test.h"

namespace selfcal::server {
namespace {

using ::testing::ElementsAre;

void ExpectSame(const SegmentEnds& a, const SegmentEnds& b) {
  EXPECT_EQ(a.key, b.key);
  ExpectSameCalibration(a.theta0, b.theta0);
  EXPECT_EQ(a.first.t_ns, b.first.t_ns);
  EXPECT_EQ(a.last.t_ns, b.last.t_ns);
  EXPECT_EQ(a.last.p_GI, b.last.p_GI);
  EXPECT_EQ(a.last.q_GI.coeffs(), b.last.q_GI.coeffs());
  EXPECT_EQ(a.last.b_g, b.last.b_g);
  EXPECT_EQ(a.Lambda, b.Lambda);
  EXPECT_EQ(a.eta, b.eta);
  ASSERT_EQ(a.tail.size(), b.tail.size());
  EXPECT_EQ(a.tail[1].t_ns, b.tail[1].t_ns);
}

TEST(SegmentEnds, ComeBackToTheBit) {
  const SegmentEnds ends = FakeEnds(TestRig("a"), {"s", 7});
  const std::string bytes = SerializeEnds(ends);
  const auto parsed = ParseEnds(bytes);
  ASSERT_TRUE(parsed.ok()) << parsed.status();
  ExpectSame(*parsed, ends);
  for (const std::size_t size : {std::size_t{0}, bytes.size() / 2}) {
    EXPECT_TRUE(absl::IsDataLoss(ParseEnds(bytes.substr(0, size)).status()))
        << size;
  }
}

// Tables of two; the first two segments fill them, and start run 1.
class RememberedTest : public StoreTest {
 protected:
  void SetUp() override {
    rig_ = CreateTestRig("a");
    for (int k = 0; k < 2; ++k) Take(k, -50);
  }

  void Take(std::int64_t k, double entropy, const std::string& session = "s") {
    ASSERT_TRUE(domain_->PutSegment("a", Segment(k, session)).ok());
    ASSERT_TRUE(domain_
                    ->CommitScore("a",
                                  {session, k},
                                  FakeInformation(rig_, entropy),
                                  FakeEnds(rig_, {session, k}))
                    .ok());
  }

  ScoreBasis Basis(std::int64_t active) const {
    return {active, PriorSigmas(rig_)};
  }

  // By index; whether each is remembered by its ends.
  std::vector<std::pair<std::int64_t, bool>> Remembered(std::int64_t run = 1) {
    std::vector<std::pair<std::int64_t, bool>> listed;
    const auto remembered = domain_->ListRemembered("a", run);
    EXPECT_TRUE(remembered.ok()) << remembered.status();
    for (const RememberedSegment& one : *remembered) {
      listed.emplace_back(one.key.index, one.ends.has_value());
      EXPECT_GT(one.time_ns, 0);
      if (one.ends) ExpectSame(*one.ends, FakeEnds(rig_, one.key));
    }
    return listed;
  }

  Rig rig_;
};

TEST_P(RememberedTest, WhatLosesItsDataIsKnownByItsEnds) {
  for (int k = 2; k < 2 + kReserve + 2; ++k) Take(k, 50);
  Reopen();
  EXPECT_THAT(Remembered(),
              ElementsAre(std::pair(0, false),
                          std::pair(1, false),
                          std::pair(2, true),
                          std::pair(3, true),
                          std::pair(4, false),
                          std::pair(5, false),
                          std::pair(6, false),
                          std::pair(7, false)));
}

// Also where their segments came in turn.
TEST_P(RememberedTest, SessionsFollowEachOther) {
  Take(2, 50, "a later one");
  Take(3, 50);
  Take(4, 50, "a later one");
  std::vector<std::int64_t> indices;
  for (const auto& [index, has_ends] : Remembered()) indices.push_back(index);
  EXPECT_THAT(indices, ElementsAre(0, 1, 3, 2, 4));
}

TEST_P(RememberedTest, WhatIsUnusableOrDoesNotFitIsForgotten) {
  for (int k = 2; k < 2 + kReserve + 2; ++k) Take(k, 50);
  ASSERT_TRUE(domain_->MarkUnusable("a", {"s", 2}, "damaged").ok());
  SegmentInformation outliers = FakeInformation(rig_, 50);
  outliers.residuals.many_outliers = true;
  ASSERT_TRUE(domain_->PutSegment("a", Segment(8)).ok());
  ASSERT_TRUE(
      domain_->CommitScore("a", {"s", 8}, outliers, FakeEnds(rig_, {"s", 8}))
          .ok());
  std::map<std::int64_t, bool> listed;
  for (const auto& one : Remembered()) listed.insert(one);
  EXPECT_FALSE(listed.contains(2));
  EXPECT_TRUE(listed.at(3));
  EXPECT_FALSE(listed.contains(8));
}

TEST_P(RememberedTest, ThereIsABoundAndTheOldestGo) {
  constexpr int kSegments = kRemembered + kReserve + 5;
  for (int k = 2; k < 2 + kSegments; ++k) Take(k, 50);
  const auto listed = Remembered();
  // The tables, the bounded memory, the reserve, and what lost its data since
  // something was last forgotten.
  EXPECT_GE(listed.size(), 2u + kRemembered + kReserve);
  EXPECT_LE(listed.size(), 2u + kRemembered + kReserve + 1);
  EXPECT_EQ(listed.front(), std::pair(std::int64_t{0}, false));
  EXPECT_GT(listed[2].first, 5);
  EXPECT_EQ(listed.back().first, 1 + kSegments);
}

TEST_P(RememberedTest, ALaterScoreTakesThePlaceOfTheFirst) {
  SegmentInformation better = FakeInformation(rig_, -70.0, 6.0);
  better.theta0.cameras[0].f.x() += 1;
  const SegmentEnds ends = FakeEnds(rig_, {"s", 1});
  ASSERT_TRUE(
      domain_->ReplaceScore("a", Basis(1), {"s", 1}, better, ends).ok());
  const auto segment = store_->GetSegment("a", {"s", 1});
  ASSERT_TRUE(segment.ok() && segment->information);
  EXPECT_EQ(segment->information->theta0.cameras[0].f.x(),
            better.theta0.cameras[0].f.x());
  const auto tables = store_->GetTables("a");
  ASSERT_TRUE(tables.ok());
  for (const Table& table : *tables) {
    ASSERT_EQ(table.entries.size(), 2u);
    EXPECT_EQ(table.entries[0].key.index, 1);
    EXPECT_EQ(table.entries[0].entropy, -70.0);
    EXPECT_EQ(table.entries[0].gain, 6.0);
    EXPECT_EQ(table.entries[1].entropy, -50.0);
  }
}

TEST_P(RememberedTest, NoScoreTakesThePlaceWhereTheDataIsGone) {
  for (int k = 2; k < 3 + kReserve; ++k) Take(k, 50);
  ASSERT_FALSE(HasData("a", 2));
  ASSERT_TRUE(domain_
                  ->ReplaceScore("a",
                                 Basis(1),
                                 {"s", 2},
                                 FakeInformation(rig_, -99.0),
                                 FakeEnds(rig_, {"s", 99}))
                  .ok());
  EXPECT_EQ(store_->GetSegment("a", {"s", 2})->information->groups[0].entropy,
            50.0);
  EXPECT_THAT(Remembered(), ::testing::Contains(std::pair(2, true)));
  EXPECT_TRUE(
      absl::IsNotFound(domain_->ReplaceScore("a",
                                             Basis(1),
                                             {"s", 77},
                                             FakeInformation(rig_, 1),
                                             FakeEnds(rig_, {"s", 77}))));
}

// One that was begun before another version became active.
TEST_P(RememberedTest, NoScoreOfAnotherVersionTakesThePlaceOfTheFirst) {
  ASSERT_TRUE(domain_->BeginRun("a", 1).ok());
  StoredCalibration next;
  next.state = CalibrationState::kActive;
  next.theta = rig_.factory;
  const int size = TangentSize(next.theta);
  next.covariance = Eigen::MatrixXd::Identity(size, size);
  ASSERT_TRUE(domain_->FinishRun("a", 1, next).ok());
  const auto replace = [&](std::int64_t active) {
    return domain_->ReplaceScore("a",
                                 Basis(active),
                                 {"s", 1},
                                 FakeInformation(rig_, -70.0 - active, 6.0),
                                 FakeEnds(rig_, {"s", 1}));
  };
  const auto entropy = [&] {
    return store_->GetSegment("a", {"s", 1})->information->groups[0].entropy;
  };
  const double before = entropy();
  EXPECT_TRUE(absl::IsFailedPrecondition(replace(1)));
  EXPECT_EQ(entropy(), before);
  EXPECT_TRUE(replace(2).ok());
  EXPECT_EQ(entropy(), -72.0);
  ASSERT_TRUE(domain_->ActivateCalibration("a", 1, "me", "back").ok());
  EXPECT_TRUE(absl::IsFailedPrecondition(replace(2)));
  EXPECT_TRUE(replace(1).ok());
}

SELFCAL_STORE_TEST_SUITE(RememberedTest);

}  // namespace
}  // namespace selfcal::server
