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
#include <cstdint>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <thread>

#include "server/store/driver/driver.h"
#include "server/store/sqlite/sqlite_connection.h"
#include "server/store/sqlite/sqlite_writer.h"
#include "server/store/sqlite/write_queue.h"

namespace selfcal::server {

class SqliteDatabase final : public Database {
 public:
  // `open_writer` is called first and creates or migrates the file at `path`.
  static absl::StatusOr<std::unique_ptr<SqliteDatabase>> Open(
      const std::string& path, SqliteWriter::Opener open_writer);
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
  SqliteDatabase(std::string path, SqliteWriter::Opener open_writer);
  absl::Status OpenConnections();
  absl::Status Recover();
  void Run();
  void Commit(std::span<QueuedWrite> group);
  bool CommitTogether(std::span<QueuedWrite> group);
  absl::Status CheckInPlace();
  void Failed(const absl::Status& status);
  void WakeToRecover();

  const std::string path_;
  const std::unique_ptr<DatabaseCopies> copies_;
  SqliteWriter writer_;  // used by the thread alone once it runs
  std::mutex read_mutex_;
  std::unique_ptr<SqliteConnection> reader_;  // guarded by read_mutex_
  std::atomic<bool> failed_ = false;          // disk error: to be reopened
  std::atomic<bool> moved_ = false;           // the files are not in place
  std::atomic<std::int64_t> commits_ = 0;
  WriteQueue queue_;
  std::thread thread_;
};

}  // namespace selfcal::server
