// Rigs are looked at when their time has come, and only then: the runs that are
// started are those that looking at every rig would start.
#include "server/domain/checks.h"

#include <map>
#include <random>

#include "server/domain/session_trigger.h"
#include "server/domain/time_triggers.h"
#include "server/store/rigs.h"
#include "server/store/segment_rows.h"
#include "test/server/store/store_test.h"
#include "test/server/test_records.h"

namespace selfcal::server {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::UnorderedElementsAre;
using ::testing::UnorderedElementsAreArray;

constexpr std::int64_t kOneSecond_ns = 1'000'000'000;
constexpr std::int64_t kIdle_ns = 60 * kOneSecond_ns;
constexpr std::int64_t kMaxAge_ns = 150 * kOneSecond_ns;
// The delay of a rule about time after a change.
constexpr std::int64_t kDelay_ns = 60 * kOneSecond_ns;

class ChecksTest : public StoreTest {
 protected:
  ChecksTest() { now_ns_ = 1000 * kOneSecond_ns; }

  Rig Create(const std::string& id, bool ages) {
    Rig rig = TestRig(id);
    rig.table_size = 6;
    RigPolicy policy;
    if (ages) policy.calibration_max_age_ns = kMaxAge_ns;
    EXPECT_TRUE(domain_->CreateRig(rig, policy).ok());
    return rig;
  }

  std::vector<std::string> Waiting(RigCheck check) {
    return *store_->ListRigsToCheck(check, kNoCheck - 1, 100);
  }

  // True if `create` would create a run of the rig now.
  template <typename Create>
  bool Would(const std::string& rig, const Create& create) {
    bool would = false;
    const absl::Status status =
        store_->Transact(rig, now_ns_, [&](UnitOfWork* tx) {
          const auto run = create(tx);
          EXPECT_TRUE(run.ok()) << run.status();
          would = run.ok() && run->has_value();
          return absl::AbortedError("only a trial");
        });
    EXPECT_TRUE(absl::IsAborted(status)) << status;
    return would;
  }
  bool IsSessionDue(const std::string& rig) {
    return Would(
        rig, [&](UnitOfWork* tx) -> absl::StatusOr<std::optional<StoredRun>> {
          const auto newest = NewestArrival(tx);
          if (!newest.ok()) return newest.status();
          if (*newest > now_ns_ - kIdle_ns) return std::nullopt;
          return CreateSessionRun(tx);
        });
  }
  bool IsAgedRunDue(const std::string& rig) {
    return Would(
        rig, [&](UnitOfWork* tx) -> absl::StatusOr<std::optional<StoredRun>> {
          const auto stored = ReadRig(tx);
          if (!stored.ok()) return stored.status();
          const auto check = ApplyTimeTriggers(tx, *stored, now_ns_);
          if (!check.ok()) return check.status();
          return check->started;
        });
  }

  // Ends the unfinished run of the rig, if there is one, by chance.
  bool EndRun(const Rig& rig, std::mt19937* random) {
    const auto runs = store_->ListUnfinishedRuns();
    for (const StoredRun& run : runs.value()) {
      if (run.rig != rig.id) continue;
      EXPECT_TRUE(domain_->BeginRun(rig.id, run.run).ok());
      if ((*random)() % 4 == 0) {
        EXPECT_TRUE(
            domain_->EndRun(rig.id, run.run, RunState::kFailed, "why").ok());
        return true;
      }
      const auto finished =
          domain_->FinishRun(rig.id, run.run, TestCalibration(rig, run));
      EXPECT_TRUE(finished.ok()) << finished.status();
      return true;
    }
    return false;
  }
};
SELFCAL_STORE_TEST_SUITE(ChecksTest);

TEST_P(ChecksTest, ARigThatDoesNotChangeIsNotLookedAtAgain) {
  for (const char* id : {"a", "b", "c"}) Create(id, id[0] == 'c');
  const auto check = [&] {
    EXPECT_THAT(*domain_->StartTimedRuns(now_ns_), IsEmpty());
    EXPECT_THAT(*domain_->StartSessionRuns({}, now_ns_ - kIdle_ns), IsEmpty());
  };
  check();
  EXPECT_THAT(Waiting(RigCheck::kSession), IsEmpty());
  EXPECT_THAT(Waiting(RigCheck::kTime), IsEmpty());
  now_ns_ += kOneSecond_ns;
  for (const char* id : {"b", "c"}) {
    Put(id, 0);
    Score(TestRig(id), 0, 1);
  }
  EXPECT_THAT(Waiting(RigCheck::kSession), UnorderedElementsAre("b", "c"));
  EXPECT_THAT(Waiting(RigCheck::kTime), ElementsAre("c"));
  now_ns_ += kIdle_ns;
  check();
  EXPECT_THAT(Waiting(RigCheck::kSession), IsEmpty());
  EXPECT_THAT(Waiting(RigCheck::kTime), IsEmpty());
  // The other one has the rule from now on.
  const auto change = [](const StoredRig& rig) -> absl::StatusOr<StoredRig> {
    StoredRig changed = rig;
    changed.policy.calibration_max_age_ns = kMaxAge_ns;
    return changed;
  };
  ASSERT_TRUE(domain_->UpdateRig("a", change, "me").ok());
  EXPECT_THAT(Waiting(RigCheck::kTime), ElementsAre("a"));
}

TEST_P(ChecksTest, ADamagedRigHoldsUpNoOther) {
  for (const char* id : {"a", "b"}) Create(id, true);
  store_.reset();
  ASSERT_TRUE(GetParam().damage(folder_, "rigs", "definition").ok());
  Reopen();
  EXPECT_THAT(*domain_->StartTimedRuns(now_ns_), IsEmpty());
  EXPECT_THAT(Waiting(RigCheck::kTime), IsEmpty());
}

TEST_P(ChecksTest, RunsAreThoseThatLookingAtEveryRigWouldStart) {
  std::mt19937 random(11);
  std::vector<Rig> rigs;
  std::map<std::string, std::int64_t> changed;  // when, at the latest
  for (const char* id : {"a", "b", "c"})
    rigs.push_back(Create(id, id[0] > 'a'));
  std::map<std::string, std::int64_t> next;
  int sessions = 0;
  int aged = 0;
  for (int k = 0; k < 400; ++k) {
    const Rig& rig = rigs[random() % rigs.size()];
    const auto chance = random() % 20;
    bool is_changed = true;
    if (chance < 9) {
      Put(rig.id, next[rig.id]);
      Score(rig, next[rig.id]++, static_cast<double>(random() % 100));
    } else if (chance == 9) {
      Put(rig.id, next[rig.id]);
      ASSERT_TRUE(
          domain_->MarkUnusable(rig.id, {"s", next[rig.id]++}, "why").ok());
    } else if (chance == 10 && next[rig.id] > 0) {
      const auto index = static_cast<std::int64_t>(random() % next[rig.id]);
      ASSERT_TRUE(
          domain_->QuarantineSegments(rig.id, "s", index, "me", "why").ok());
    } else if (chance == 11) {
      is_changed = domain_->CreateManualRun(rig.id).ok();
    } else if (chance < 17) {
      is_changed = EndRun(rig, &random);
    } else {
      is_changed = false;
      now_ns_ += static_cast<std::int64_t>(random() % 200) * kOneSecond_ns;
    }
    if (is_changed) changed[rig.id] = now_ns_;
    now_ns_ += static_cast<std::int64_t>(random() % 3) * kOneSecond_ns;
    if (k % 50 == 49) Reopen();

    // Not at every step, or aged calibrations would be rare.
    if (k % 4 == 0) {
      std::vector<std::string> expected;
      for (const Rig& other : rigs) {
        if (IsSessionDue(other.id)) expected.push_back(other.id);
      }
      std::vector<std::string> started;
      const auto session_runs =
          domain_->StartSessionRuns({}, now_ns_ - kIdle_ns);
      for (const StoredRun& run : session_runs.value()) {
        started.push_back(run.rig);
        changed[run.rig] = now_ns_;
      }
      ASSERT_THAT(started, UnorderedElementsAreArray(expected)) << k;
      sessions += static_cast<int>(started.size());
    }

    std::map<std::string, bool> due;
    for (const Rig& other : rigs) due[other.id] = IsAgedRunDue(other.id);
    std::map<std::string, bool> aged_runs;
    const auto timed_runs = domain_->StartTimedRuns(now_ns_);
    for (const StoredRun& run : timed_runs.value()) {
      aged_runs[run.rig] = true;
      ++aged;
    }
    for (const Rig& other : rigs) {
      if (due[other.id] && now_ns_ - changed[other.id] >= kDelay_ns) {
        EXPECT_TRUE(aged_runs[other.id]) << k;
      }
      if (aged_runs[other.id]) {
        EXPECT_TRUE(due[other.id]) << k;
        changed[other.id] = now_ns_;
      }
    }
  }
  EXPECT_GT(sessions, 10);
  EXPECT_GT(aged, 3);
}

}  // namespace
}  // namespace selfcal::server
