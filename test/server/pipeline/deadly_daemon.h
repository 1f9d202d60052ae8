// A daemon, in a process of its own, that kills itself on one side of a commit
// or in the solver, for tests of what it leaves and of what the next one does.
#pragma once

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <functional>
#include <memory>
#include <utility>

#include "core/calibration/calibrate.h"
#include "core/model/rig.h"
#include "server/store/driver/driver.h"

namespace selfcal::server {

// Where the process kills itself; 0: nowhere.
struct Bomb {
  int before_commit = 0;
  int after_commit = 0;
  int iteration = 0;
};
// Those of the child, which counts over all threads of the store.
inline Bomb bomb;
inline std::atomic<int> commits;
inline std::atomic<int> committed;

// Kills the process at the end of a transaction, before it is committed, or
// once it is.
class DeadlyDatabase final : public Database {
 public:
  explicit DeadlyDatabase(std::unique_ptr<Database> database)
      : database_(std::move(database)) {}

  absl::Status Write(Work work) override {
    const absl::Status status = database_->Write(Deadly(std::move(work)));
    NoteCommitted(status);
    return status;
  }
  void BeginWrite(Work work, Done done) override {
    database_->BeginWrite(Deadly(std::move(work)),
                          [done = std::move(done)](const absl::Status& status) {
                            NoteCommitted(status);
                            done(status);
                          });
  }
  absl::Status Read(const Work& query) override {
    return database_->Read(query);
  }
  absl::Status ReadForService(const Work& query) override {
    return database_->ReadForService(query);
  }
  absl::StatusOr<std::unique_ptr<Connection>> OpenReader() override {
    return database_->OpenReader();
  }
  std::unique_ptr<Listener> Listen(const Listener::Heard& heard) override {
    return database_->Listen(heard);
  }
  DatabaseCopies* copies() override { return database_->copies(); }

 private:
  static Work Deadly(Work work) {
    return [work = std::move(work)](Connection* db) {
      absl::Status status = work(db);
      if (status.ok() && ++commits == bomb.before_commit) raise(SIGKILL);
      return status;
    };
  }
  static void NoteCommitted(const absl::Status& status) {
    if (status.ok() && ++committed == bomb.after_commit) raise(SIGKILL);
  }

  const std::unique_ptr<Database> database_;
};

// A solver of three iterations.
inline CalibrationResult SolveOrDie(const Rig& rig,
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

// Runs `live`, which exits, in a process of its own. True if it was killed,
// false if it reached its end.
inline bool IsKilled(const std::function<void()>& live) {
  const pid_t child = fork();
  if (child == 0) live();
  int status = 0;
  EXPECT_EQ(waitpid(child, &status, 0), child);
  if (WIFEXITED(status)) {
    EXPECT_EQ(WEXITSTATUS(status), 0);
    return false;
  }
  EXPECT_EQ(WTERMSIG(status), SIGKILL);
  return true;
}

}  // namespace selfcal::server
