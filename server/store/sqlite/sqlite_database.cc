#include "server/store/sqlite/sqlite_database.h"

#include <future>
#include <utility>
#include <vector>

#include "server/status/status_macros.h"
#include "server/store/driver/statement.h"
#include "server/store/driver/transaction.h"
#include "server/store/sqlite/copies.h"

namespace selfcal::server {
namespace {

// Bounds how long the first write of a group waits for the last.
constexpr std::size_t kMaxGroup = 64;

// True if the disk failed, rather than the write or the query.
bool IsDiskError(const absl::Status& status) {
  return absl::IsUnavailable(status);
}

absl::Status Checking() {
  return absl::UnavailableError(
      "the disk has failed: the database is being checked; try again, and look "
      "into the system's log");
}

absl::Status Moved(const std::string& path) {
  return absl::FailedPreconditionError(
      path +
      " or its log was removed or replaced while it was in use: nothing is "
      "accepted any more; stop the daemon, put the state directory back or "
      "restore a backup, and start it again");
}

absl::Status QuickCheck(SqliteConnection* connection) {
  Statement check(connection, "PRAGMA quick_check(1)");
  if (!check.Next()) return check.status();
  const std::string words = check.Text(0);
  if (words == "ok") return absl::OkStatus();
  return absl::DataLossError(
      "the database is damaged: stop the daemon, keep a copy of the file, and "
      "restore a backup (quick_check: " +
      words + ")");
}

}  // namespace

absl::StatusOr<std::unique_ptr<SqliteDatabase>> SqliteDatabase::Open(
    const std::string& path, SqliteWriter::Opener open_writer) {
  std::unique_ptr<SqliteDatabase> database(
      new SqliteDatabase(path, std::move(open_writer)));
  SELFCAL_RETURN_IF_ERROR(database->OpenConnections());
  database->thread_ = std::thread([raw = database.get()] { raw->Run(); });
  return database;
}

SqliteDatabase::SqliteDatabase(std::string path,
                               SqliteWriter::Opener open_writer)
    : path_(std::move(path)),
      copies_(MakeSqliteCopies(path_)),
      writer_(path_, std::move(open_writer)) {}

SqliteDatabase::~SqliteDatabase() {
  queue_.Stop();
  if (thread_.joinable()) thread_.join();
  // The writer closes last: closing it moves the log into the file.
  reader_.reset();
  writer_.Close();
}

absl::Status SqliteDatabase::OpenConnections() {
  const std::lock_guard lock(read_mutex_);
  reader_.reset();
  SELFCAL_RETURN_IF_ERROR(writer_.Open());
  SELFCAL_ASSIGN_OR_RETURN(reader_, SqliteConnection::OpenReader(path_));
  return absl::OkStatus();
}

absl::Status SqliteDatabase::Recover() {
  SELFCAL_RETURN_IF_ERROR(OpenConnections());
  SELFCAL_RETURN_IF_ERROR(QuickCheck(writer_.connection()));
  Statement checkpoint(writer_.connection(), "PRAGMA wal_checkpoint(TRUNCATE)");
  const bool found = checkpoint.Next();
  SELFCAL_RETURN_IF_ERROR(checkpoint.status());
  if (!found || checkpoint.Int(0) != 0) return Checking();
  failed_ = false;
  return absl::OkStatus();
}

void SqliteDatabase::Failed(const absl::Status& status) {
  if (IsDiskError(status)) failed_ = true;
}

absl::Status SqliteDatabase::Read(const Work& query) {
  const std::lock_guard lock(read_mutex_);
  if (moved_) return Moved(path_);
  if (failed_ || reader_ == nullptr) {
    WakeToRecover();
    return Checking();
  }
  const Snapshot snapshot(reader_.get());
  Failed(snapshot.status());
  SELFCAL_RETURN_IF_ERROR(snapshot.status());
  absl::Status status = query(reader_.get());
  Failed(status);
  return status;
}

// Makes the writing thread reopen the database, without waiting for it: that
// thread could be waiting for a reader.
void SqliteDatabase::WakeToRecover() {
  queue_.PushIfEmpty({[](Connection*) { return absl::OkStatus(); },
                      [](const absl::Status&) {}});
}

void SqliteDatabase::BeginWrite(Work work, Done done) {
  queue_.Push({std::move(work), std::move(done)});
}

absl::Status SqliteDatabase::Write(Work work) {
  // Shared, because this function may return before set_value has.
  const auto committed = std::make_shared<std::promise<absl::Status>>();
  BeginWrite(std::move(work), [committed](const absl::Status& status) {
    committed->set_value(status);
  });
  return committed->get_future().get();
}

absl::StatusOr<std::unique_ptr<Connection>> SqliteDatabase::OpenReader() {
  SELFCAL_ASSIGN_OR_RETURN(std::unique_ptr<Connection> reader,
                           SqliteConnection::OpenReader(path_));
  return reader;
}

void SqliteDatabase::Run() {
  for (;;) {
    std::vector<QueuedWrite> group = queue_.Take(kMaxGroup);
    if (group.empty()) return;
    Commit(group);
    for (const QueuedWrite& write : group) write.done(write.status);
    group.clear();  // releases their memory before the checkpoint
    if (!failed_) Failed(writer_.CheckpointIfLarge());
  }
}

absl::Status SqliteDatabase::CheckInPlace() {
  moved_ = !writer_.IsInPlace();
  return moved_ ? Moved(path_) : absl::OkStatus();
}

void SqliteDatabase::Commit(std::span<QueuedWrite> group) {
  if (moved_) {
    for (QueuedWrite& write : group) write.status = Moved(path_);
    return;
  }
  if (failed_) {
    const absl::Status recovered = Recover();
    if (!recovered.ok()) {
      failed_ = true;
      for (QueuedWrite& write : group) write.status = recovered;
      return;
    }
  }
  if (CommitTogether(group) || group.size() == 1) return;
  // One of them may have been too large for an almost full disk: try each
  // alone.
  for (QueuedWrite& write : group) {
    if (failed_) {
      write.status = Checking();
    } else {
      CommitTogether({&write, 1});
    }
  }
}

// False if nothing was committed and each write deserves a try of its own; true
// if the statuses are final.
bool SqliteDatabase::CommitTogether(std::span<QueuedWrite> group) {
  const auto fail = [&](const absl::Status& status) {
    Failed(status);
    for (QueuedWrite& write : group) write.status = status;
    return IsDiskError(status);
  };
  SqliteConnection* const db = writer_.connection();
  Transaction transaction(db);
  if (!transaction.status().ok()) return fail(transaction.status());
  for (QueuedWrite& write : group) {
    write.status = RunGuarded(write.work, db);
    if (IsDiskError(write.status) || !db->in_transaction()) {
      const absl::Status lost =
          write.status.ok()
              ? absl::InternalError("a write ended the transaction")
              : write.status;
      return fail(lost);
    }
  }
  const absl::Status committed = transaction.Commit();
  if (!committed.ok()) return fail(committed);
  ++commits_;
  const absl::Status in_place = CheckInPlace();
  for (QueuedWrite& write : group) write.status.Update(in_place);
  return true;
}

}  // namespace selfcal::server
