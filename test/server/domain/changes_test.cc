#include "server/domain/alarms.h"
#include "test/core/change/random_information.h"
#include "test/server/store/store_test.h"

namespace selfcal::server {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

// A device whose segments are drawn about its truth, as good as a reference
// segment each; tables of two.
class ChangesTest : public StoreTest {
 protected:
  void SetUp() override {
    rig_ = TestRig("a");
    ASSERT_TRUE(domain_->CreateRig(rig_, policy_).ok());
    // Two segments fill the tables, and the run gives version 2.
    Many(2, zero_);
    ASSERT_TRUE(domain_->BeginRun("a", 1).ok());
    const auto finished = domain_->FinishRun("a", 1, Result(rig_.factory));
    ASSERT_TRUE(finished.ok()) << finished.status();
    ASSERT_EQ(finished->state, CalibrationState::kActive);
  }

  // What a run comes to.
  StoredCalibration Result(const Calibration& theta) const {
    StoredCalibration calibration;
    calibration.theta = theta;
    calibration.covariance = FactoryKnownTo(rig_, 0.04).covariance;
    calibration.report = CalibrationResult();
    calibration.report->status = CalibrateStatus::kConverged;
    calibration.report->track_noise_factor = track_noise_factor_;
    return calibration;
  }

  // Puts and scores the next segment of a device that is off by `offset`.
  ScoreCommit Next(const Eigen::VectorXd& offset, double fit = 1) {
    Put("a", next_);
    SegmentInformation information =
        random_.Segment(rig_, rig_.factory, offset);
    information.residuals.fit = fit;
    information.groups = ScoreGroups(rig_, information.Lambda);
    const auto commit = domain_->CommitScore("a", {"s", next_++}, information);
    EXPECT_TRUE(commit.ok()) << commit.status();
    return commit.value_or(ScoreCommit());
  }
  void Many(int count, const Eigen::VectorXd& offset) {
    for (int i = 0; i < count; ++i) Next(offset);
  }

  // The device turns its camera: segments until that is noticed. The index of
  // the first of them is first_after_.
  StoredChange Shock() {
    first_after_ = next_;
    for (int i = 0; i < 8; ++i) {
      if (auto commit = Next(turned_); commit.change) return *commit.change;
    }
    ADD_FAILURE() << "the change was not detected";
    return {};
  }

  // The active version that the next run gives, on segments since the change.
  StoredCalibration RunAfterChange() {
    std::optional<StoredRun> run;
    while (!run && next_ < 60) run = Next(turned_).started_run;
    if (!run) {
      // One from before may still be under way.
      EXPECT_EQ(store_->ListUnfinishedRuns()->size(), 1u);
      run = store_->ListUnfinishedRuns()->front();
    }
    EXPECT_TRUE(domain_->BeginRun("a", run->run).ok());
    const auto finished = domain_->FinishRun(
        "a", run->run, Result(BoxPlus(rig_.factory, turned_)));
    EXPECT_TRUE(finished.ok()) << finished.status();
    if (!finished.ok()) return {};
    EXPECT_EQ(finished->state, CalibrationState::kActive);
    return *finished;
  }

  std::vector<Alarm> Alarms() {
    const auto listed = store_->ListRigSummaries({}, {100, ""});
    EXPECT_TRUE(listed.ok()) << listed.status();
    return AlarmsOf(listed->items.at(0), NowNs());
  }

  std::vector<StoredEvent> Events() {
    auto events = store_->ListEvents({1000, ""});
    EXPECT_TRUE(events.ok()) << events.status();
    return events->items;
  }

  double track_noise_factor_ = 1;
  RigPolicy policy_;
  Rig rig_;
  const Eigen::VectorXd zero_ =
      Eigen::VectorXd::Zero(TangentSize(HandheldRig("a").factory));
  const Eigen::VectorXd turned_ = [this] {
    Eigen::VectorXd offset = zero_;
    const Rig rig = HandheldRig("a");
    const int i =
        MatchComponents(TangentComponents(rig.factory), {"cam0.q_CI.x"}).at(0);
    offset(i) = 15 * ReferenceSigmas(rig)(i);
    return offset;
  }();
  RandomInformation random_{5};
  std::int64_t next_ = 0;
  std::int64_t first_after_ = 0;
};
SELFCAL_STORE_TEST_SUITE(ChangesTest);

// Of a device that may have turned its camera by itself within a millisecond.
class WalkingTest : public ChangesTest {
 protected:
  WalkingTest() { policy_.walk_densities = {{"*.q_CI.*", 1e6}}; }
};
SELFCAL_STORE_TEST_SUITE(WalkingTest);

TEST_P(WalkingTest, WhatComponentsDoByThemselvesIsNoChange) {
  EXPECT_EQ(store_->GetRig("a")->policy, policy_);
  // Since the version: a step among the segments is seen whatever it explains.
  for (int i = 0; i < 16; ++i) EXPECT_FALSE(Next(turned_).change) << i;
}

TEST_P(ChangesTest, WithoutOneNothingHappens) {
  for (int i = 0; i < 40; ++i) {
    EXPECT_FALSE(Next(zero_).change) << "segment " << i;
  }
  EXPECT_TRUE(absl::IsNotFound(store_->GetChange("a", 1).status()));
}

TEST_P(ChangesTest, SegmentsOfOtherDevicesShowNone) {
  for (int i = 0; i < 20; ++i) {
    const Eigen::VectorXd other = 40 * random_.Direction(rig_);
    EXPECT_FALSE(Next(i % 5 == 3 ? other : zero_).change) << i;
  }
}

// As soon as the segment after it shows that the device is still the same.
TEST_P(ChangesTest, SegmentsOfOtherDevicesAreQuarantined) {
  Many(4, zero_);
  const SegmentKey other = {"s", next_};
  Next(40 * random_.Direction(rig_));
  const auto quarantined = [&] {
    std::vector<std::string> texts;
    for (const StoredEvent& event : Events()) {
      if (event.kind == EventKind::kSegmentQuarantined) {
        texts.push_back(event.detail);
      }
    }
    return texts;
  };
  EXPECT_THAT(quarantined(), ::testing::IsEmpty());
  Next(zero_);
  EXPECT_THAT(quarantined(),
              ElementsAre(::testing::HasSubstr("another theta than")));
  const auto tables = store_->GetTables("a");
  ASSERT_TRUE(tables.ok()) << tables.status();
  for (const Table& table : *tables) {
    for (const auto& entry : table.entries) {
      EXPECT_NE(entry.key, other) << table.group;
    }
  }
  Many(6, zero_);
  EXPECT_EQ(quarantined().size(), 1u);
  // A device that has changed stays changed.
  Shock();
  EXPECT_EQ(quarantined().size(), 1u);
}

TEST_P(ChangesTest, SegmentsThatDoNotFitShowNone) {
  Many(6, zero_);
  for (int i = 0; i < 8; ++i) EXPECT_FALSE(Next(turned_, 2).change) << i;
}

TEST_P(ChangesTest, SegmentsFromBeforeLeaveTheTables) {
  Many(6, zero_);
  const StoredChange change = Shock();
  EXPECT_EQ(change.change, 1);
  EXPECT_EQ(change.base_version, 2);
  EXPECT_EQ(change.kind, ChangeKind::kSudden);
  EXPECT_THAT(change.groups, ElementsAre("extrinsics"));
  // Sequences count from 1, indices from 0.
  EXPECT_GT(change.first_sequence, first_after_ + 1);
  EXPECT_LE(change.first_sequence, next_ + 1);
  const auto tables = store_->GetTables("a");
  ASSERT_TRUE(tables.ok());
  for (const Table& table : *tables) {
    EXPECT_EQ(table.scored, next_ - (change.first_sequence - 1));
    for (const TableEntry& entry : table.entries) {
      EXPECT_GE(entry.sequence, change.first_sequence) << table.group;
    }
  }
  int left = 0;
  for (std::int64_t k = 0; k < next_; ++k) {
    const auto exclusions = store_->ListExclusions("a", {"s", k});
    ASSERT_TRUE(exclusions.ok()) << exclusions.status();
    for (const auto& exclusion : *exclusions) {
      if (exclusion.cause != ExclusionCause::kDeviceChanged) continue;
      EXPECT_LT(k + 1, change.first_sequence) << "from before";
      ++left;
    }
  }
  EXPECT_GT(left, 0);
  const StoredEvent event = Events().back();
  EXPECT_EQ(event.kind, EventKind::kChangeDetected);
  EXPECT_THAT(event.detail, HasSubstr("extrinsics"));
  EXPECT_THAT(event.detail, HasSubstr("chi-square"));
}

TEST_P(ChangesTest, TheNextRunIsOnSegmentsAfterItAlone) {
  Many(6, zero_);
  const StoredChange change = Shock();
  // One that still runs is of the device before, and no other starts meanwhile.
  const auto unfinished = store_->ListUnfinishedRuns();
  ASSERT_TRUE(unfinished.ok()) << unfinished.status();
  for (const StoredRun& run : *unfinished) {
    ASSERT_EQ(run.change, 0);
    ASSERT_TRUE(
        domain_->EndRun("a", run.run, RunState::kCancelled, "test").ok());
  }
  std::optional<StoredRun> started;
  for (int i = 0; i < 4 && !started; ++i) started = Next(turned_).started_run;
  ASSERT_TRUE(started);
  EXPECT_EQ(started->trigger, RunTrigger::kChangeDetected);
  EXPECT_EQ(started->change, 1);
  EXPECT_EQ(started->base_version, 2);
  ASSERT_FALSE(started->segments.empty());
  for (const SegmentKey& key : started->segments) {
    EXPECT_GE(key.index + 1, change.first_sequence);
    EXPECT_GE(key.index, first_after_);
  }
  Reopen();
  const auto run = store_->GetRun("a", started->run);
  ASSERT_TRUE(run.ok()) << run.status();
  EXPECT_EQ(run->trigger, RunTrigger::kChangeDetected);
  EXPECT_EQ(run->change, 1);
  EXPECT_EQ(run->segments, started->segments);
}

TEST_P(ChangesTest, AVersionFromBeforeIsKnownAsSuchUntilOneReplacesIt) {
  EXPECT_EQ(store_->GetActiveCalibration("a")->changed_since, 0);
  EXPECT_THAT(Alarms(), ::testing::IsEmpty());
  Shock();
  EXPECT_EQ(store_->GetActiveCalibration("a")->changed_since, 1);
  EXPECT_THAT(Alarms(), ElementsAre(Alarm::kDeviceChanged));
  const StoredCalibration after = RunAfterChange();
  EXPECT_EQ(after.changed_since, 0);
  EXPECT_THAT(Alarms(), ::testing::IsEmpty());
  // Whoever goes back to it goes back to the device before.
  ASSERT_TRUE(domain_->ActivateCalibration("a", 2, "eve", "trial").ok());
  EXPECT_EQ(store_->GetActiveCalibration("a")->changed_since, 1);
  EXPECT_EQ(store_->GetCalibration("a", 1)->changed_since, 0) << "no estimate";
  EXPECT_THAT(Alarms(), ElementsAre(Alarm::kDeviceChanged));
  Reopen();
  EXPECT_THAT(Alarms(), ElementsAre(Alarm::kDeviceChanged));
}

TEST_P(ChangesTest, NothingIsTestedUntilThereIsACalibrationAfterIt) {
  Many(6, zero_);
  Shock();
  for (int i = 0; i < 20; ++i) EXPECT_FALSE(Next(turned_).change);
}

TEST_P(ChangesTest, ASecondOneIsFoundAgainstTheCalibrationAfterTheFirst) {
  Shock();
  const StoredCalibration finished = RunAfterChange();
  const StoredCalibration calibration = Result(BoxPlus(rig_.factory, turned_));
  // Estimated with the calibration before, it is too far to be tested.
  EXPECT_FALSE(Next(zero_).change);
  const auto next = [&](const Eigen::VectorXd& offset) {
    Put("a", next_);
    SegmentInformation information =
        random_.Segment(rig_, calibration.theta, offset);
    information.groups = ScoreGroups(rig_, information.Lambda);
    return domain_->CommitScore("a", {"s", next_++}, information);
  };
  for (int i = 0; i < 10; ++i) EXPECT_FALSE(next(zero_)->change);
  std::optional<StoredChange> second;
  for (int i = 0; i < 8 && !second; ++i) second = next(turned_)->change;
  ASSERT_TRUE(second);
  EXPECT_EQ(second->change, 2);
  EXPECT_EQ(second->base_version, finished.version);
}

// Whatever they show, the version rests on them.
TEST_P(ChangesTest, SegmentsThatAVersionRemembersAreNotTestedAgainstIt) {
  constexpr int kLater = 8;
  std::optional<StoredRun> run;
  while (!run && next_ < 200) run = Next(zero_).started_run;
  ASSERT_TRUE(run);
  for (int i = 0; i < kLater; ++i) Put("a", next_ + i);
  ASSERT_TRUE(domain_->BeginRun("a", run->run).ok());
  StoredCalibration result = Result(rig_.factory);
  result.report->remembered.segments = kLater;
  result.report->remembered.newest = {"s", next_ + kLater - 1};
  ASSERT_EQ(domain_->FinishRun("a", run->run, result)->state,
            CalibrationState::kActive);
  for (int i = 0; i < kLater; ++i) {
    SegmentInformation information =
        random_.Segment(rig_, rig_.factory, turned_);
    information.groups = ScoreGroups(rig_, information.Lambda);
    const auto commit = domain_->CommitScore("a", {"s", next_++}, information);
    ASSERT_TRUE(commit.ok()) << commit.status();
    EXPECT_FALSE(commit->change) << i;
  }
  // The fixture's turn is found among later ones.
  EXPECT_GE(Shock().first_sequence, next_ - 8);
}

TEST_P(ChangesTest, ARunFromBeforeIsRejected) {
  // A run of the tables as they were before is under way.
  std::optional<StoredRun> run;
  while (!run && next_ < 200) run = Next(zero_).started_run;
  ASSERT_TRUE(run);
  ASSERT_TRUE(domain_->BeginRun("a", run->run).ok());
  const StoredChange change = Shock();
  const auto finished = domain_->FinishRun("a", run->run, Result(rig_.factory));
  ASSERT_TRUE(finished.ok()) << finished.status();
  EXPECT_EQ(finished->state, CalibrationState::kRejected);
  EXPECT_THAT(finished->reasons, ElementsAre(HasSubstr("change 1")));
  EXPECT_EQ(store_->GetActiveCalibration("a")->version, change.base_version);
}

// The segments of the next run are of two devices, as its result tells.
class SplitRunTest : public ChangesTest {
 protected:
  void BeginNext() {
    std::optional<StoredRun> run;
    while (!run && next_ < 200) run = Next(zero_).started_run;
    ASSERT_TRUE(run);
    run_ = *run;
    ASSERT_TRUE(domain_->BeginRun("a", run_.run).ok());
  }

  // A version that rests on all segments so far; `session`: that of the newest.
  StoredCalibration FinishOnAll(const std::string& session = "s") {
    BeginNext();
    StoredCalibration result = Result(rig_.factory);
    result.report->remembered.segments = 1;
    result.report->remembered.newest = {session, next_ - 1};
    const auto finished = domain_->FinishRun("a", run_.run, result);
    EXPECT_TRUE(finished.ok()) << finished.status();
    return finished.value_or(StoredCalibration());
  }

  // `failed`: a check that rejects the result. `first`: the index of the first
  // segment of the second device; by default the last but two.
  StoredCalibration FinishSplit(double without_one,
                                const std::string& failed = "",
                                std::optional<std::int64_t> first = {}) {
    BeginNext();
    StoredCalibration result = Result(rig_.factory);
    result.report->remembered.split = {
        .probability = without_one / 2,
        .without_one = without_one,
        .newer = 3,
        .first = {"s", first.value_or(next_ - 3)},
        .block = "cam0.q_CI",
        .concerned = {"extrinsics"}};
    if (!failed.empty()) {
      result.state = CalibrationState::kRejected;
      result.reasons = {"It failed."};
      result.validation = StoredValidation();
      result.validation->active_version = 2;
      result.validation->checks = {
          {failed, 0, 0, CheckOutcome::kFailed, "It failed."}};
    }
    const auto finished = domain_->FinishRun("a", run_.run, result);
    EXPECT_TRUE(finished.ok()) << finished.status();
    return finished.value_or(StoredCalibration());
  }

  StoredRun run_;
};
SELFCAL_STORE_TEST_SUITE(SplitRunTest);

TEST_P(SplitRunTest, ASureOneIsAChangeOfTheDevice) {
  const StoredCalibration finished = FinishSplit(0.9e-4);
  // It accounts for the change.
  EXPECT_EQ(finished.state, CalibrationState::kActive);
  EXPECT_EQ(store_->GetActiveCalibration("a")->version, finished.version);
  EXPECT_EQ(finished.changed_since, 0);
  EXPECT_EQ(store_->GetCalibration("a", 2)->changed_since, 1);
  EXPECT_THAT(Alarms(), ::testing::IsEmpty());
  const auto change = store_->GetChange("a", 1);
  ASSERT_TRUE(change.ok()) << change.status();
  EXPECT_EQ(change->first_sequence, next_ - 3 + 1);  // indices count from 0
  // Version 2 rests on the first of these segments.
  EXPECT_EQ(change->base_version, 1);
  EXPECT_EQ(change->kind, ChangeKind::kSudden);
  EXPECT_THAT(change->groups, ElementsAre("extrinsics"));
  const auto tables = store_->GetTables("a");
  ASSERT_TRUE(tables.ok()) << tables.status();
  for (const Table& table : *tables) {
    EXPECT_EQ(table.scored, 3);
    for (const TableEntry& entry : table.entries) {
      EXPECT_GE(entry.sequence, change->first_sequence) << table.group;
    }
  }
  const std::vector<StoredEvent> events = Events();
  EXPECT_EQ(std::count_if(events.begin(),
                          events.end(),
                          [](const StoredEvent& event) {
                            return event.kind == EventKind::kChangeDetected &&
                                   event.detail.find("cam0.q_CI") !=
                                       std::string::npos;
                          }),
            1);
  // The split is kept with the candidate.
  Reopen();
  const auto report = store_->GetCalibration("a", finished.version)->report;
  ASSERT_TRUE(report && report->remembered.split);
  EXPECT_EQ(report->remembered.split->first, (SegmentKey{"s", next_ - 3}));
  EXPECT_EQ(report->remembered.split->newer, 3);
  EXPECT_THAT(report->remembered.split->concerned, ElementsAre("extrinsics"));
}

// Otherwise a segment would count twice: for what is known from before, and for
// the estimate since.
TEST_P(SplitRunTest, WhatRemainsKnownIsNotFromTheSegmentsSince) {
  const StoredCalibration third = FinishOnAll();
  const std::int64_t newest = next_ - 1;
  const StoredCalibration fourth = FinishOnAll();
  ASSERT_EQ(fourth.version, 4);
  ASSERT_EQ(FinishSplit(1e-6, "", newest + 1).version, 5);
  EXPECT_EQ(run_.base_version, 4);
  EXPECT_EQ(store_->GetChange("a", 1)->base_version, third.version);
}

// As of a segment that was deleted.
TEST_P(SplitRunTest, NorFromAVersionThatMayRestOnThem) {
  FinishOnAll("deleted");
  FinishSplit(1e-6, "", next_);
  EXPECT_EQ(run_.base_version, 3);
  EXPECT_EQ(store_->GetChange("a", 1)->base_version, 2);
}

TEST_P(SplitRunTest, IfEveryVersionRestsOnThemNothingRemainsKnown) {
  FinishOnAll();
  FinishSplit(1e-6, "", 1);  // version 2 rests on two segments
  EXPECT_EQ(store_->GetChange("a", 1)->base_version, 1);
}

TEST_P(SplitRunTest, WhatDoesNotFitShowsNone) {
  EXPECT_EQ(FinishSplit(1e-6, "pixel_residuals").state,
            CalibrationState::kRejected);
  EXPECT_TRUE(absl::IsNotFound(store_->GetChange("a", 1).status()));
}

TEST_P(SplitRunTest, OneThatExplainsWhyTheRunWasRejectedIsOne) {
  EXPECT_EQ(FinishSplit(1e-6, "halves").state, CalibrationState::kRejected);
  EXPECT_TRUE(store_->GetChange("a", 1).ok());
  EXPECT_EQ(store_->GetActiveCalibration("a")->changed_since, 1);
}

TEST_P(SplitRunTest, OneThatIsNotSureIsNone) {
  EXPECT_EQ(FinishSplit(1.1e-4).state, CalibrationState::kActive);
  EXPECT_TRUE(absl::IsNotFound(store_->GetChange("a", 1).status()));
}

TEST_P(ChangesTest, IsFoundTheSameAcrossRestarts) {
  Many(6, zero_);
  first_after_ = next_;
  std::optional<StoredChange> change;
  for (int i = 0; i < 8 && !change; ++i) {
    Reopen();
    change = Next(turned_).change;
  }
  ASSERT_TRUE(change);
  Reopen();
  const auto stored = store_->GetChange("a", 1);
  ASSERT_TRUE(stored.ok()) << stored.status();
  EXPECT_EQ(stored->first_sequence, change->first_sequence);
  EXPECT_EQ(stored->groups, change->groups);
  EXPECT_EQ(stored->kind, change->kind);
  EXPECT_EQ(stored->time_ns, change->time_ns);
  EXPECT_EQ(stored->base_version, 2);
  EXPECT_EQ(stored->inflation, 1);
}

class NoisyTracksTest : public ChangesTest {
 protected:
  NoisyTracksTest() { track_noise_factor_ = 1.5; }
};
SELFCAL_STORE_TEST_SUITE(NoisyTracksTest);

TEST_P(NoisyTracksTest, SegmentsAreTakenForAsNoisyAsTheCalibrationFound) {
  Many(6, zero_);
  const StoredChange change = Shock();
  EXPECT_EQ(change.inflation, 2.25);
  EXPECT_THAT(Events().back().detail, HasSubstr("times 2.25"));
}

class UnmeasuredNoiseTest : public ChangesTest {
 protected:
  UnmeasuredNoiseTest() { track_noise_factor_ = 0; }
};
SELFCAL_STORE_TEST_SUITE(UnmeasuredNoiseTest);

TEST_P(UnmeasuredNoiseTest, NothingIsTestedWithoutHonestSigmas) {
  for (int i = 0; i < 8; ++i) EXPECT_FALSE(Next(turned_).change);
}

}  // namespace
}  // namespace selfcal::server
