// A daemon that is killed on either side of every commit of a run, and in the
// solver: the trigger still gives one run, and that one version.
#include <signal.h>
#include <sqlite3.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <string_view>

#include "test/promise.h"
#include "test/server/pipeline/pipeline_test.h"

namespace selfcal::server {
namespace {

// Where the process kills itself; 0: nowhere.
struct Bomb {
  int before_commit = 0;
  int after_commit = 0;
  int iteration = 0;
};
Bomb bomb;  // of the child, as what it counts over all threads of the store
std::atomic<int> commits;
std::atomic<int> committed;

int BeforeCommit(void*) {
  if (++commits == bomb.before_commit) raise(SIGKILL);
  return 0;
}

// Called when a statement has run to its end.
int AfterStatement(unsigned, void*, void* statement, void*) {
  const char* sql = sqlite3_sql(static_cast<sqlite3_stmt*>(statement));
  const bool commit = sql != nullptr && std::string_view(sql) == "COMMIT";
  if (commit && ++committed == bomb.after_commit) raise(SIGKILL);
  return 0;
}

int Watch(sqlite3* db, char**, const sqlite3_api_routines*) {
  sqlite3_commit_hook(db, BeforeCommit, nullptr);
  sqlite3_trace_v2(db, SQLITE_TRACE_PROFILE, AfterStatement, nullptr);
  return SQLITE_OK;
}

CalibrationResult Solve(const Rig& rig,
                        const Calibration& start,
                        const ProgressCallback& progress) {
  CalibrationResult result;
  result.status = CalibrateStatus::kConverged;
  result.theta = start;
  result.theta.cameras[0].f.x() += 0.5;
  result.covariance = PriorSigmas(rig).cwiseAbs2().asDiagonal();
  result.observations = 1000;
  result.halves = {25, 26, 0.5};
  for (int k = 1; k <= 3; ++k) {
    if (k == bomb.iteration) raise(SIGKILL);
    if (!progress({k, 3, 1.0, 1.0}))
      result.status = CalibrateStatus::kCancelled;
  }
  return result;
}

MotionSegment Segment(std::int64_t index) {
  MotionSegment segment = TestSegments(TestRig("any"), 1).front();
  segment.key.index = index;
  return segment;
}

bool Ended(Store* store) {
  const auto run = store->GetRun("a", 1);
  return run.ok() && run->end_time_ns != 0;
}

// The life of a daemon, until the run of two segments has ended.
[[noreturn]] void Live(const std::string& path, const Bomb& planted) {
  bomb = planted;
  sqlite3_auto_extension(reinterpret_cast<void (*)()>(Watch));
  auto store = OpenSqliteStore(path);
  if (!store.ok()) _exit(2);
  Domain domain(store->get());
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
    return Solve(rig, start, progress);
  };
  PipelineOptions options;
  const auto pipeline = MakePipeline(&domain, options, estimators);
  if (!pipeline->Start().ok()) _exit(4);
  for (const std::int64_t index : {0, 1}) {
    if (!pipeline->Submit("a", Segment(index), nullptr).ok()) _exit(5);
  }
  if (!Eventually([&] { return Ended(store->get()); })) _exit(6);
  pipeline->Stop();
  _exit(0);
}

// Whether it was killed, rather than having reached its end.
bool LiveAndDie(const std::string& path, const Bomb& planted) {
  const pid_t child = fork();
  if (child == 0) Live(path, planted);
  int status = 0;
  EXPECT_EQ(waitpid(child, &status, 0), child);
  if (WIFEXITED(status)) {
    EXPECT_EQ(WEXITSTATUS(status), 0);
    return false;
  }
  EXPECT_EQ(WTERMSIG(status), SIGKILL);
  return true;
}

bool OneRunGaveOneVersion(const std::string& path) {
  const auto store = OpenSqliteStore(path);
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

// Kills one life there, and lets the next go on. Whether there was one to kill.
bool TryOnce(const Bomb& planted, Counts* counts) {
  const TempFolder folder;
  const std::string path = folder.File("selfcal.db");
  if (!LiveAndDie(path, planted)) return false;
  EXPECT_FALSE(LiveAndDie(path, {}));
  ++counts->trials;
  const bool kept = OneRunGaveOneVersion(path);
  EXPECT_TRUE(kept) << "killed at commit " << planted.before_commit << " or "
                    << planted.after_commit << ", iteration "
                    << planted.iteration;
  counts->lost += kept ? 0 : 1;
  return true;
}

TEST(RunKillTest, OneRunForEachTriggerHoweverItIsKilled) {
#if defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "ThreadSanitizer cannot start threads in a forked process";
#endif
  Counts counts;
  const int rounds = Trials(1);
  for (int round = 0; round < rounds; ++round) {
    int steps = 0;
    for (int n = 1; TryOnce({n, 0, 0}, &counts); ++n) ++steps;
    for (int n = 1; TryOnce({0, n, 0}, &counts); ++n) ++steps;
    for (int n = 1; TryOnce({0, 0, n}, &counts); ++n) ++steps;
    // Put and score twice, begin, candidate, finish: on both sides.
    EXPECT_GT(steps, 14);
  }
  Promise promise("one run for each trigger, over any kill");
  promise.trials = counts.trials;
  promise.lost = counts.lost;
}

}  // namespace
}  // namespace selfcal::server
