// An SQLite file shared by many threads: one connection that writes, one that
// reads.
//
// Group commit: writes that arrive while another is being committed share one
// transaction and one sync. Each is a savepoint in it, so that one that fails
// leaves the others as they are. A write is answered only after the COMMIT that
// includes it.
//
// The writing connection also moves the log into the file (a checkpoint) once
// it is large, after the writes of a group were answered: SQLite before 3.51.3
// can damage a database in which two connections write or checkpoint at once.
//
// All writes run on one thread of this class, in the order of their arrival.
// Reads run on the thread of the caller, in a snapshot, and never wait for a
// sync.
//
// After a disk error nothing is served until the database has been closed,
// reopened, checked (quick_check) and its log moved into the file: the system
// may have dropped what it could not sync.
//
// If the file or its log was removed or replaced, nothing is served any more
// (FAILED_PRECONDITION): what is written then is lost with the open files.
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

#include "server/store/driver/driver.h"
#include "server/store/sqlite/file_identity.h"
#include "server/store/sqlite/sqlite_connection.h"

namespace selfcal::server {

class SqliteDatabase final : public Database {
 public:
  using Opener =
      std::function<absl::StatusOr<std::unique_ptr<SqliteConnection>>()>;

  // `open_writer` is called first and creates or migrates the file at `path`.
  static absl::StatusOr<std::unique_ptr<SqliteDatabase>> Open(
      const std::string& path, Opener open_writer);
  // Carries out the queued writes.
  ~SqliteDatabase() override;
  SqliteDatabase(const SqliteDatabase&) = delete;
  SqliteDatabase& operator=(const SqliteDatabase&) = delete;

  absl::Status Write(Work work) override;
  void BeginWrite(Work work, Done done) override;
  absl::Status Read(const Work& query) override;
  absl::StatusOr<std::unique_ptr<Connection>> OpenReader() override;
  DatabaseCopies* copies() override { return copies_.get(); }

  // Successful COMMITs, each with one sync; fewer than the writes where writes
  // were grouped.
  std::int64_t commits() const { return commits_; }

 private:
  struct Job {
    Work work;
    Done done;
    absl::Status status = absl::OkStatus();
  };

  SqliteDatabase(std::string path, Opener open_writer);
  absl::Status OpenConnections();
  absl::Status Recover();
  void Run();
  void Commit(std::span<Job> group);
  bool CommitTogether(std::span<Job> group);
  absl::Status CheckInPlace();
  void CheckpointIfLarge();
  void Failed(const absl::Status& status);
  void WakeToRecover();

  const std::string path_;
  const Opener open_writer_;
  const std::unique_ptr<DatabaseCopies> copies_;
  // Used by the thread alone once it runs.
  std::unique_ptr<SqliteConnection> writer_;
  FileIdentity file_;
  std::optional<FileIdentity> log_;  // of the file, since the first commit
  int log_pages_ = 0;                // after the last commit
  std::int64_t checkpoint_pages_ = 0;
  std::mutex read_mutex_;
  std::unique_ptr<SqliteConnection> reader_;  // guarded by read_mutex_
  std::atomic<bool> failed_ = false;          // disk error: to be reopened
  std::atomic<bool> moved_ = false;           // the files are not in place
  std::atomic<std::int64_t> commits_ = 0;

  std::mutex mutex_;  // guards what follows
  std::condition_variable arrived_;
  std::deque<Job> queue_;
  bool stopping_ = false;
  std::thread thread_;
};

}  // namespace selfcal::server
