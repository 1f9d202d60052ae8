// A daemon that is killed on either side of every commit of a run, and in the
// solver: the trigger still gives one run, and that one version.
#include <unistd.h>

#include <utility>

#include "test/promise.h"
#include "test/server/pipeline/deadly_daemon.h"
#include "test/server/pipeline/pipeline_test.h"
#include "test/server/store/store_test.h"

namespace selfcal::server {
namespace {

MotionSegment Segment(std::int64_t index) {
  MotionSegment segment = TestSegments(TestRig("any"), 1).front();
  segment.key.index = index;
  return segment;
}

bool Ended(Store* store) {
  const auto run = store->GetRun("a", 1);
  return run.ok() && run->end_time_ns != 0;
}

class RunKillTest : public ::testing::TestWithParam<Engine> {
 protected:
  // The life of a daemon, until the run of two segments has ended.
  [[noreturn]] static void Live(const TempFolder& folder, const Bomb& planted);
  // Whether it was killed, rather than having reached its end.
  static bool LiveAndDie(const TempFolder& folder, const Bomb& planted);
  static bool OneRunGaveOneVersion(const TempFolder& folder);
};
SELFCAL_STORE_TEST_SUITE(RunKillTest);

void RunKillTest::Live(const TempFolder& folder, const Bomb& planted) {
  bomb = planted;
  auto database = GetParam().open_database(folder, 0);
  if (!database.ok()) _exit(2);
  const auto store =
      MakeStore(std::make_unique<DeadlyDatabase>(*std::move(database)));
  Domain domain(store.get());
  const auto rig = domain.CreateRig(TestRig("a"));
  if (!rig.ok() && !absl::IsAlreadyExists(rig.status())) _exit(3);
  Estimators estimators;
  estimators.score =
      [](const Rig& rig, const Calibration&, const MotionSegment&) {
        return FakeInformation(rig, 1.0);
      };
  estimators.calibrate = [](const Rig& rig,
                            const Calibration& start,
                            const auto&,
                            const auto&,
                            const ProgressCallback& progress,
                            const auto&) {
    return SolveOrDie(rig, start, progress);
  };
  PipelineOptions options;
  const auto pipeline = MakePipeline(&domain, options, estimators);
  if (!pipeline->Start().ok()) _exit(4);
  for (const std::int64_t index : {0, 1}) {
    if (!pipeline->Submit("a", Segment(index), nullptr).ok()) _exit(5);
  }
  if (!Eventually([&] { return Ended(store.get()); })) _exit(6);
  pipeline->Stop();
  _exit(0);
}

bool RunKillTest::LiveAndDie(const TempFolder& folder, const Bomb& planted) {
  return IsKilled([&] { Live(folder, planted); });
}

bool RunKillTest::OneRunGaveOneVersion(const TempFolder& folder) {
  const auto store = GetParam().open(folder, 0);
  if (!store.ok()) return false;
  const auto runs = (*store)->ListRuns("a", {});
  const auto versions = (*store)->ListCalibrations("a", {});
  return runs.ok() && runs->items.size() == 1 &&
         runs->items[0].state == RunState::kSucceeded &&
         runs->items[0].calibration_version == 2 && versions.ok() &&
         versions->items.size() == 2 &&
         versions->items[0].state == CalibrationState::kActive &&
         versions->items[0].run == 1;
}

struct Counts {
  int trials = 0;
  int lost = 0;
};

TEST_P(RunKillTest, OneRunForEachTriggerHoweverItIsKilled) {
#if defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "ThreadSanitizer cannot start threads in a forked process";
#endif
  Counts counts;
  // Kills one life there, and lets the next go on. Whether there was one to
  // kill.
  const auto try_once = [&](const Bomb& planted) {
    const TempFolder folder;
    // The parent creates what the folder stands for: the child has no part in
    // the server of an engine that has one.
    if (!GetParam().open(folder, 0).ok()) return false;
    if (!LiveAndDie(folder, planted)) return false;
    EXPECT_FALSE(LiveAndDie(folder, {}));
    ++counts.trials;
    const bool kept = OneRunGaveOneVersion(folder);
    EXPECT_TRUE(kept) << "killed at commit " << planted.before_commit << " or "
                      << planted.after_commit << ", iteration "
                      << planted.iteration;
    counts.lost += kept ? 0 : 1;
    return true;
  };
  const int rounds = Trials(1);
  for (int round = 0; round < rounds; ++round) {
    int steps = 0;
    for (int n = 1; try_once({n, 0, 0}); ++n) ++steps;
    for (int n = 1; try_once({0, n, 0}); ++n) ++steps;
    for (int n = 1; try_once({0, 0, n}); ++n) ++steps;
    // Put and score twice, begin, candidate, finish: on both sides.
    EXPECT_GT(steps, 14);
  }
  Promise promise("one run for each trigger, over any kill");
  promise.trials = counts.trials;
  promise.lost = counts.lost;
}

}  // namespace
}  // namespace selfcal::server
