// A daemon that is killed on either side of every commit of a run that scores
// at its candidate, which then is not the active version: the next daemon
// leaves no score at it.
#include <unistd.h>

#include <algorithm>

#include "test/promise.h"
#include "test/server/pipeline/deadly_daemon.h"
#include "test/server/pipeline/pipeline_test.h"
#include "test/server/store/fake_ends.h"
#include "test/server/store/store_test.h"

namespace selfcal::server {
namespace {

// Why the candidate does not become active.
enum class Refusal {
  kQuarantine,  // of a segment of the run, while this scores at the candidate
  kCancel,      // by the next daemon, before its work begins
};

class RescoringKillTest : public ::testing::TestWithParam<Engine> {
 protected:
  // The life of a daemon, until the run of two segments has ended and no score
  // is outdated.
  [[noreturn]] static void Live(const TempFolder& folder,
                                Refusal refusal,
                                const Bomb& planted);
  // The scores show the calibration at which they are computed.
  static Estimators MakeEstimators(Domain* domain, Refusal refusal);
  static double EntropyAt(const Calibration& theta) {
    return -theta.cameras[0].f.x();
  }
  static MotionSegment SegmentOf(std::int64_t index) {
    MotionSegment segment = TestSegments(TestRig("any"), 1).front();
    segment.key.index = index;
    return segment;
  }
  static bool AreScoresAtActive(const TempFolder& folder);
};
SELFCAL_STORE_TEST_SUITE(RescoringKillTest);

Estimators RescoringKillTest::MakeEstimators(Domain* domain, Refusal refusal) {
  Estimators estimators;
  estimators.score = [=](const Rig& rig,
                         const Calibration& theta,
                         const MotionSegment& segment) {
    const bool at_candidate = EntropyAt(theta) != EntropyAt(rig.factory);
    if (refusal == Refusal::kQuarantine && at_candidate &&
        segment.key.index == 1) {
      const auto quarantined =
          domain->QuarantineSegments("a", "s", 1, "eve", "wrong");
      if (!quarantined.ok()) _exit(7);
    }
    return FakeInformation(rig, EntropyAt(theta));
  };
  estimators.ends =
      [](const Rig& rig, const Calibration&, const MotionSegment& segment) {
        return FakeEnds(rig, segment.key);
      };
  estimators.calibrate = [](const Rig& rig,
                            const Calibration& start,
                            const auto&,
                            const auto&,
                            const ProgressCallback& progress,
                            const auto&) {
    return SolveOrDie(rig, start, progress);
  };
  return estimators;
}

void RescoringKillTest::Live(const TempFolder& folder,
                             Refusal refusal,
                             const Bomb& planted) {
  bomb = planted;
  auto database = GetParam().open_database(folder, 0);
  if (!database.ok()) _exit(2);
  const auto store =
      MakeStore(std::make_unique<DeadlyDatabase>(*std::move(database)));
  Domain domain(store.get());
  const auto rig = domain.CreateRig(TestRig("a"));
  if (!rig.ok() && !absl::IsAlreadyExists(rig.status())) _exit(3);
  const auto has_ended = [&] {
    const auto run = store->GetRun("a", 1);
    return run.ok() && run->end_time_ns != 0;
  };
  if (refusal == Refusal::kCancel && store->GetRun("a", 1).ok() &&
      !has_ended() &&
      !domain.EndRun("a", 1, RunState::kCancelled, "on request").ok()) {
    _exit(4);
  }
  PipelineOptions options;
  options.session_idle = std::chrono::milliseconds(0);
  options.recheck = std::chrono::milliseconds(5);
  // Outdated scores are due at once: the clock of the records stays behind.
  options.now_ns = [] { return NowNs() + 120'000'000'000; };
  const auto pipeline =
      MakePipeline(&domain, options, MakeEstimators(&domain, refusal));
  if (!pipeline->Start().ok()) _exit(5);
  for (const std::int64_t index : {0, 1}) {
    const MotionSegment segment = SegmentOf(index);
    if (store->GetSegment("a", segment.key).ok()) continue;
    if (!pipeline->Submit("a", segment, nullptr).ok()) _exit(6);
  }
  const bool ended = Eventually([&] {
    const auto outdated =
        store->ListRigsToCheck(RigCheck::kScores, kNoCheck, 1);
    return outdated.ok() && outdated->empty() && has_ended();
  });
  pipeline->Stop();
  _exit(ended ? 0 : 8);
}

bool RescoringKillTest::AreScoresAtActive(const TempFolder& folder) {
  const auto store = GetParam().open(folder, 0);
  if (!store.ok()) return false;
  const auto active = (*store)->GetActiveCalibration("a");
  SegmentQuery query;
  query.has_data = true;
  const auto kept = (*store)->ListSegments("a", query, {});
  if (!active.ok() || !kept.ok() || kept->items.empty()) return false;
  return std::all_of(
      kept->items.begin(), kept->items.end(), [&](const StoredSegment& one) {
        return one.state != SegmentState::kScored ||
               (one.information &&
                one.information->groups[0].entropy == EntropyAt(active->theta));
      });
}

TEST_P(RescoringKillTest, NoScoreOfARefusedCandidateStays) {
#if defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "ThreadSanitizer cannot start threads in a forked process";
#endif
  int trials = 0;
  int lost = 0;
  // Kills one life there, and lets the next go on. Whether there was one to
  // kill.
  const auto try_once = [&](Refusal refusal, const Bomb& planted) {
    const TempFolder folder;
    // The parent creates what the folder stands for: the child has no part in
    // the server of an engine that has one.
    if (!GetParam().open(folder, 0).ok()) return false;
    const auto is_killed = [&](const Bomb& where) {
      return IsKilled([&] { Live(folder, refusal, where); });
    };
    if (!is_killed(planted)) return false;
    EXPECT_FALSE(is_killed({}));
    ++trials;
    const bool kept = AreScoresAtActive(folder);
    EXPECT_TRUE(kept) << "killed at commit " << planted.before_commit << " or "
                      << planted.after_commit << ", "
                      << (refusal == Refusal::kCancel ? "cancelled"
                                                      : "quarantined");
    lost += kept ? 0 : 1;
    return true;
  };
  const int rounds = Trials(1);
  for (int round = 0; round < rounds; ++round) {
    for (const Refusal refusal : {Refusal::kQuarantine, Refusal::kCancel}) {
      for (int n = 1; try_once(refusal, {n, 0, 0});) ++n;
      for (int n = 1; try_once(refusal, {0, n, 0});) ++n;
    }
  }
  // Put and score twice, begin, candidate, its record, two scores at it, finish
  // and the end of the record: on both sides, and for both reasons.
  EXPECT_GT(trials, 40 * rounds);
  Promise promise("no score of a candidate outlasts it, over any kill");
  promise.trials = trials;
  promise.lost = lost;
}

}  // namespace
}  // namespace selfcal::server
