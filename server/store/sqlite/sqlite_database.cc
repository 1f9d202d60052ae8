#include "server/store/sqlite/sqlite_database.h"

#include <algorithm>
#include <future>
#include <iterator>
#include <utility>

#include "server/status/status_macros.h"
#include "server/store/driver/statement.h"
#include "server/store/driver/transaction.h"
#include "server/store/sqlite/copies.h"

namespace selfcal::server {
namespace {

// Bounds how long the first write of a group waits for the last.
constexpr std::size_t kMaxGroup = 64;

// The log is moved into the file when it is this large: several groups of
// segments, so that a page that many of them change is written once.
constexpr std::int64_t kCheckpointBytes = 32 << 20;
constexpr std::int64_t kLeastPage = 512;  // the smallest of SQLite

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

// Replaces SQLite's automatic checkpoint, which is part of a commit.
int NoteLogPages(void* log_pages, sqlite3*, const char*, int pages) {
  *static_cast<int*>(log_pages) = pages;
  return SQLITE_OK;
}

}  // namespace

absl::StatusOr<std::unique_ptr<SqliteDatabase>> SqliteDatabase::Open(
    const std::string& path, Opener open_writer) {
  std::unique_ptr<SqliteDatabase> database(
      new SqliteDatabase(path, std::move(open_writer)));
  SELFCAL_RETURN_IF_ERROR(database->OpenConnections());
  database->thread_ = std::thread([raw = database.get()] { raw->Run(); });
  return database;
}

SqliteDatabase::SqliteDatabase(std::string path, Opener open_writer)
    : path_(std::move(path)),
      open_writer_(std::move(open_writer)),
      copies_(MakeSqliteCopies(path_)) {}

SqliteDatabase::~SqliteDatabase() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  arrived_.notify_all();
  if (thread_.joinable()) thread_.join();
  // The writer closes last: closing it moves the log into the file.
  reader_.reset();
  writer_.reset();
}

absl::Status SqliteDatabase::OpenConnections() {
  const std::lock_guard lock(read_mutex_);
  reader_.reset();
  writer_.reset();
  SELFCAL_ASSIGN_OR_RETURN(writer_, open_writer_());
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t page_bytes,
                           ReadInt(writer_.get(), "PRAGMA page_size"));
  checkpoint_pages_ = kCheckpointBytes / std::max(page_bytes, kLeastPage);
  SELFCAL_ASSIGN_OR_RETURN(file_, IdentityOf(path_));
  log_.reset();
  log_pages_ = 0;
  sqlite3_wal_hook(writer_->handle(), NoteLogPages, &log_pages_);
  SELFCAL_ASSIGN_OR_RETURN(reader_, SqliteConnection::OpenReader(path_));
  return absl::OkStatus();
}

absl::Status SqliteDatabase::Recover() {
  SELFCAL_RETURN_IF_ERROR(OpenConnections());
  SELFCAL_RETURN_IF_ERROR(QuickCheck(writer_.get()));
  Statement checkpoint(writer_.get(), "PRAGMA wal_checkpoint(TRUNCATE)");
  const bool found = checkpoint.Next();
  SELFCAL_RETURN_IF_ERROR(checkpoint.status());
  if (!found || checkpoint.Int(0) != 0) return Checking();
  failed_ = false;
  return absl::OkStatus();
}

void SqliteDatabase::CheckpointIfLarge() {
  if (failed_ || log_pages_ < checkpoint_pages_) return;
  log_pages_ = 0;  // until the next commit
  // As far as readers allow; the rest next time.
  const int code = sqlite3_wal_checkpoint_v2(
      writer_->handle(), nullptr, SQLITE_CHECKPOINT_PASSIVE, nullptr, nullptr);
  if (code != SQLITE_BUSY) Failed(writer_->StatusOf(code, "checkpoint"));
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
  {
    const std::lock_guard lock(mutex_);
    if (!queue_.empty()) return;
    queue_.push_back({[](Connection*) { return absl::OkStatus(); },
                      [](const absl::Status&) {}});
  }
  arrived_.notify_all();
}

void SqliteDatabase::BeginWrite(Work work, Done done) {
  {
    const std::lock_guard lock(mutex_);
    queue_.push_back({std::move(work), std::move(done)});
  }
  arrived_.notify_all();
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
  std::unique_lock lock(mutex_);
  for (;;) {
    arrived_.wait(lock, [this] { return stopping_ || !queue_.empty(); });
    if (queue_.empty()) return;
    const auto end = std::next(
        queue_.begin(),
        static_cast<std::ptrdiff_t>(std::min(queue_.size(), kMaxGroup)));
    std::vector<Job> group(std::make_move_iterator(queue_.begin()),
                           std::make_move_iterator(end));
    queue_.erase(queue_.begin(), end);
    lock.unlock();
    Commit(group);
    for (const Job& job : group) job.done(job.status);
    group.clear();  // releases their memory before taking the lock
    CheckpointIfLarge();
    lock.lock();
  }
}

// After a commit, and before it is answered: whether it is in the files that a
// restart will find.
absl::Status SqliteDatabase::CheckInPlace() {
  const std::string log = path_ + "-wal";
  if (!log_) {
    const auto first = IdentityOf(log);
    if (first.ok()) log_ = *first;
  }
  moved_ = !StillNames(path_, file_) || !log_ || !StillNames(log, *log_);
  return moved_ ? Moved(path_) : absl::OkStatus();
}

void SqliteDatabase::Commit(std::span<Job> group) {
  if (moved_) {
    for (Job& job : group) job.status = Moved(path_);
    return;
  }
  if (failed_) {
    const absl::Status recovered = Recover();
    if (!recovered.ok()) {
      failed_ = true;
      for (Job& job : group) job.status = recovered;
      return;
    }
  }
  if (CommitTogether(group) || group.size() == 1) return;
  // One of them may have been too large for an almost full disk: try each
  // alone.
  for (Job& job : group) {
    if (failed_) {
      job.status = Checking();
    } else {
      CommitTogether({&job, 1});
    }
  }
}

// False if nothing was committed and each write deserves a try of its own; true
// if the statuses are final.
bool SqliteDatabase::CommitTogether(std::span<Job> group) {
  const auto fail = [&](const absl::Status& status) {
    Failed(status);
    for (Job& job : group) job.status = status;
    return IsDiskError(status);
  };
  Transaction transaction(writer_.get());
  if (!transaction.status().ok()) return fail(transaction.status());
  for (Job& job : group) {
    job.status = RunGuarded(job.work, writer_.get());
    if (IsDiskError(job.status) || !writer_->in_transaction()) {
      const absl::Status lost =
          job.status.ok() ? absl::InternalError("a write ended the transaction")
                          : job.status;
      return fail(lost);
    }
  }
  const absl::Status committed = transaction.Commit();
  if (!committed.ok()) return fail(committed);
  ++commits_;
  const absl::Status in_place = CheckInPlace();
  for (Job& job : group) job.status.Update(in_place);
  return true;
}

}  // namespace selfcal::server
