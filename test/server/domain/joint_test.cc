// Rigs with a joint selection: one table, filled by what the choice of
// core/selection keeps.
#include <algorithm>
#include <random>
#include <set>

#include "core/selection/joint_selection.h"
#include "proto/convert.h"
#include "selfcal/store/records.pb.h"
#include "server/domain/score_commit.h"
#include "server/store/records.h"
#include "server/store/transact.h"
#include "test/server/store/store_test.h"

namespace selfcal::server {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

class JointTest : public StoreTest {
 protected:
  Rig CreateJointRig(const std::string& id, Selection selection) {
    Rig rig = TestRig(id);
    rig.selection = selection;
    EXPECT_TRUE(domain_->CreateRig(rig).ok());
    return rig;
  }

  // Information that a score could have, with landmarks; of few or of many
  // directions.
  static SegmentInformation Information(const Rig& rig, unsigned seed) {
    SegmentInformation information = FakeInformation(rig, 0, 5, seed);
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    const int size = TangentSize(rig.factory);
    Eigen::MatrixXd root(1 + random() % size, size);
    for (auto& x : root.reshaped()) x = (1 + seed % 5) * normal(random);
    const Eigen::VectorXd unit = PriorSigmas(rig).cwiseInverse();
    information.Lambda =
        unit.asDiagonal() * (root.transpose() * root) * unit.asDiagonal();
    for (std::uint64_t id = 0; id < 60; ++id) {
      information.landmarks.entries.push_back(
          {30 * seed + id, static_cast<std::int32_t>(3 + id % 5)});
    }
    std::sort(information.landmarks.entries.begin(),
              information.landmarks.entries.end(),
              [](const auto& a, const auto& b) {
                return LandmarkHash(a.id) < LandmarkHash(b.id);
              });
    return information;
  }

  ScoreCommit Commit(const Rig& rig, int index) {
    Put(rig.id, index);
    const auto commit = domain_->CommitScore(
        rig.id, {"s", index}, Information(rig, static_cast<unsigned>(index)));
    EXPECT_TRUE(commit.ok()) << commit.status();
    if (commit.ok() && commit->started_run) {
      EXPECT_TRUE(domain_
                      ->EndRun(rig.id,
                               commit->started_run->run,
                               RunState::kCancelled,
                               "test")
                      .ok());
    }
    return commit.value_or(ScoreCommit());
  }
};
SELFCAL_STORE_TEST_SUITE(JointTest);

TEST_P(JointTest, RigComesBackWithItsOneEmptyTable) {
  for (const Selection selection :
       {Selection::kJointD, Selection::kJointA, Selection::kJointE}) {
    const std::string id = "rig" + std::to_string(static_cast<int>(selection));
    const Rig rig = CreateJointRig(id, selection);
    Reopen();
    EXPECT_EQ(store_->GetRig(id)->rig.selection, selection);
    const auto tables = store_->GetTables(id);
    ASSERT_TRUE(tables.ok());
    ASSERT_EQ(tables->size(), 1u);
    EXPECT_EQ((*tables)[0].group, "joint");
    EXPECT_EQ((*tables)[0].capacity,
              static_cast<int>(rig.groups.size()) * rig.table_size);
    EXPECT_THAT((*tables)[0].entries, IsEmpty());
  }
}

TEST_P(JointTest, LandmarksComeBackToTheBit) {
  const Rig rig = CreateJointRig("a", Selection::kJointD);
  Commit(rig, 3);
  Reopen();
  const auto segment = store_->GetSegment("a", {"s", 3});
  ASSERT_TRUE(segment.ok());
  EXPECT_EQ(segment->information->landmarks, Information(rig, 3).landmarks);
}

// Against the choice itself, offered the same segments.
TEST_P(JointTest, TableHoldsTheChoiceAndItsDataAlways) {
  for (const Selection selection : {Selection::kJointD, Selection::kJointA}) {
    const std::string id = "rig" + std::to_string(static_cast<int>(selection));
    const Rig rig = CreateJointRig(id, selection);
    const JointSettings settings =
        MakeJointSettings(rig, CriterionOf(selection));
    std::vector<Candidate> candidates;
    for (int k = 0; k < 24; ++k) {
      candidates.push_back(MakeCandidate(
          rig, {"s", k}, k + 1, Information(rig, static_cast<unsigned>(k))));
      const ScoreCommit commit = Commit(rig, k);
      if (k % 7 == 3) Reopen();
      std::set<std::int64_t> expected;
      for (const int i : SelectStreaming(settings, candidates)) {
        expected.insert(i);
      }
      std::set<std::int64_t> kept;
      const std::vector<std::int64_t> indices = TableIndices(id, 0);
      kept.insert(indices.begin(), indices.end());
      ASSERT_EQ(kept, expected) << "after " << k;
      const std::vector<std::string> entered =
          kept.contains(k) ? std::vector<std::string>{"joint"}
                           : std::vector<std::string>{};
      EXPECT_EQ(commit.tables, entered);
      EXPECT_EQ(store_->GetSegment(id, {"s", k})->tables, entered);
      EXPECT_EQ((*store_->GetTables(id))[0].scored, k + 1);
      // The newest that are not kept are the reserve.
      std::set<std::int64_t> reserve;
      for (int i = k; i >= 0 && reserve.size() < 4; --i) {
        if (!kept.contains(i)) reserve.insert(i);
      }
      for (int i = 0; i <= k; ++i) {
        ASSERT_EQ(HasData(id, i), kept.contains(i) || reserve.contains(i))
            << i << " after " << k;
        const auto exclusions = store_->ListExclusions(id, {"s", i});
        ASSERT_EQ(exclusions->empty(), kept.contains(i)) << i << " after " << k;
      }
    }
    EXPECT_EQ(static_cast<int>(TableIndices(id, 0).size()), settings.capacity);
  }
}

// A decision is made before the transaction that uses it: by then another
// segment may have changed the table.
TEST_P(JointTest, ADecisionOnAnotherTableIsMadeAgain) {
  const std::optional<JointDecision> none;
  std::vector<std::vector<TableEntry>> entries;
  for (const bool early : {false, true}) {
    const std::string id = early ? "early" : "late";
    const Rig rig = CreateJointRig(id, Selection::kJointD);
    for (int k = 0; k < 8; ++k) Commit(rig, k);
    Put(id, 8);
    const SegmentInformation information = Information(rig, 8);
    const auto decide = [&] {
      return InspectFor(store_.get(), id, [&](UnitOfWork* tx) {
        return DecideJointly(tx, {"s", 8}, information);
      });
    };
    const auto before = decide();
    ASSERT_TRUE(before.ok() && before->has_value());
    Commit(rig, 9);
    const auto after = decide();
    ASSERT_TRUE(after.ok() && after->has_value());
    ASSERT_NE((*before)->kept, (*after)->kept);
    const auto commit =
        TransactFor(store_.get(), id, NowNs(), [&](UnitOfWork* tx) {
          return CommitScore(tx,
                             {"s", 8},
                             information,
                             std::nullopt,
                             early ? *before : none,
                             ChangeOptions());
        });
    ASSERT_TRUE(commit.ok()) << commit.status();
    EXPECT_THAT(commit->tables, ElementsAre("joint"));
    entries.push_back((*store_->GetTables(id))[0].entries);
  }
  EXPECT_EQ(entries[0], entries[1]);
}

TEST_P(JointTest, ARunStartsWithAsManyAsOneGroupNeeds) {
  const Rig rig = CreateJointRig("a", Selection::kJointD);  // 2 of 6
  Put("a", 4);
  EXPECT_FALSE(
      domain_->CommitScore("a", {"s", 4}, Information(rig, 4))->started_run);
  Put("a", 9);
  const auto commit = domain_->CommitScore("a", {"s", 9}, Information(rig, 9));
  ASSERT_TRUE(commit->started_run.has_value());
  EXPECT_EQ(commit->started_run->trigger, RunTrigger::kTablesFull);
  EXPECT_THAT(commit->started_run->segments,
              ElementsAre(SegmentKey{"s", 4}, SegmentKey{"s", 9}));
}

TEST_P(JointTest, AKeptSegmentOfDamagedInformationIsQuarantined) {
  const Rig rig = CreateJointRig("a", Selection::kJointD);
  Commit(rig, 4);
  store_.reset();
  ASSERT_TRUE(
      GetParam().damage(folder_, "segment_information", "information").ok());
  Reopen();
  Commit(rig, 9);
  EXPECT_THAT(TableIndices("a", 0), ElementsAre(9));
  EXPECT_TRUE(HasData("a", 9));
  EXPECT_TRUE(absl::IsFailedPrecondition(
      store_->GetSegmentData("a", {"s", 4}).status()));
  const auto events = store_->ListEvents({1000, ""});
  ASSERT_TRUE(events.ok());
  EXPECT_TRUE(std::any_of(
      events->items.begin(), events->items.end(), [](const auto& event) {
        return event.kind == EventKind::kSegmentUnusable &&
               event.detail.find("s~4") != std::string::npos;
      }));
}

// Rigs of a time when there was no choice.
TEST(RigRecord, ARigStoredWithoutASelectionKeepsItsTables) {
  Rig rig = TestRig("a");
  rig.selection = Selection::kJointD;
  store::RigRecord record;
  *record.mutable_rig() = ToProto(rig);
  EXPECT_EQ(ParseRig(record.SerializeAsString(), "test")->rig.selection,
            Selection::kJointD);
  record.mutable_rig()->clear_selection();
  EXPECT_EQ(ParseRig(record.SerializeAsString(), "test")->rig.selection,
            Selection::kTables);
}

}  // namespace
}  // namespace selfcal::server
