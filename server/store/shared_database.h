// A database that many threads use: one connection that writes, one that reads.
//
// Group commit: changes that arrive while another is being committed join one
// transaction and one sync. Each is a savepoint in it, so that one that fails
// leaves the others as they are. A change is answered only after the COMMIT
// that it was part of.
//
// The one that writes also moves the log into the file (a checkpoint), by
// size, after those who wait were answered: SQLite before 3.51.3 can damage a
// database where two connections write or do so at once.
//
// All changes run on one thread of this class, in the order in which they came.
// Reads run on the thread of the caller, in a snapshot, and never wait for a
// sync.
//
// After an error of the disk nothing is served until the database has been
// closed, opened again, checked (quick_check) and its log moved into the file:
// what the system could not sync it may have forgotten.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "server/store/statement.h"

namespace selfcal::server {

class SharedDatabase {
 public:
  // A change opens one Transaction, which fails or commits as a whole. It may
  // run again, alone, if the transaction that it was part of failed for
  // another reason.
  using Work = std::function<absl::Status(Connection*)>;
  // Called once, on the thread that writes; short, and calls nothing of this
  // class but Write.
  using Done = std::function<void(const absl::Status&)>;
  using Opener = std::function<absl::StatusOr<Connection>()>;

  // `open_writer` comes first and creates or migrates the file at `path`.
  static absl::StatusOr<std::unique_ptr<SharedDatabase>> Open(
      const std::string& path, Opener open_writer);
  // Carries out what is queued.
  ~SharedDatabase();
  SharedDatabase(const SharedDatabase&) = delete;
  SharedDatabase& operator=(const SharedDatabase&) = delete;

  void Write(Work change, Done done);
  // Waits until it is committed.
  absl::Status Write(Work change);
  absl::Status Read(const Work& query);

  // COMMITs that were answered, each of which synced: less than the changes
  // where changes have joined.
  std::int64_t commits() const { return commits_; }

 private:
  struct Job {
    Work change;
    Done done;
    absl::Status status = absl::OkStatus();
  };

  SharedDatabase(std::string path, Opener open_writer);
  absl::Status OpenConnections();
  absl::Status Recover();
  void Run();
  void Commit(std::span<Job> group);
  bool CommitTogether(std::span<Job> group);
  void CheckpointIfLarge();
  void Failed(const absl::Status& status);
  void WakeToRecover();

  const std::string path_;
  const Opener open_writer_;
  // Of the thread alone, once it runs.
  std::optional<Connection> writer_;
  int log_pages_ = 0;  // after the last commit
  std::int64_t checkpoint_pages_ = 0;
  std::mutex read_mutex_;
  std::optional<Connection> reader_;  // guarded by read_mutex_
  std::atomic<bool> failed_ = false;  // the disk; to be opened again
  std::atomic<std::int64_t> commits_ = 0;

  std::mutex mutex_;  // guards what follows
  std::condition_variable arrived_;
  std::deque<Job> queue_;
  bool stopping_ = false;
  std::thread thread_;
};

}  // namespace selfcal::server
