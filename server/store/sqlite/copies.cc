#include "server/store/sqlite/copies.h"

#include <fmt/format.h>

#include <atomic>
#include <fstream>
#include <mutex>
#include <utility>
#include <vector>

#include "server/status/status_macros.h"
#include "server/store/sqlite/database_file.h"
#include "server/store/sqlite/restore.h"
#include "server/store/sqlite/sqlite_connection.h"

namespace selfcal::server {
namespace {

constexpr std::size_t kPiece = 1 << 20;
constexpr int kMaxExports = 4;

// Removes its file when destroyed, however much of it was written.
class TemporaryDatabase {
 public:
  explicit TemporaryDatabase(std::string path) : path_(std::move(path)) {}
  ~TemporaryDatabase() { RemoveDatabaseFiles(path_).IgnoreError(); }
  TemporaryDatabase(const TemporaryDatabase&) = delete;
  TemporaryDatabase& operator=(const TemporaryDatabase&) = delete;

  const std::string& path() const { return path_; }

 private:
  const std::string path_;
};

// One of the exports that may be read at the same time: each occupies the disk.
class Turn {
 public:
  explicit Turn(std::atomic<int>* taken) : taken_(taken), number_(++*taken) {}
  ~Turn() { --*taken_; }
  Turn(const Turn&) = delete;
  Turn& operator=(const Turn&) = delete;

  bool granted() const { return number_ <= kMaxExports; }

 private:
  std::atomic<int>* const taken_;
  const int number_;
};

// Copies one state of `from` to a file that needs no log beside it.
absl::Status Copy(SqliteConnection* from, const std::string& to) {
  SELFCAL_RETURN_IF_ERROR(RemoveDatabaseFiles(to));
  SELFCAL_ASSIGN_OR_RETURN(
      const auto copy,
      SqliteConnection::Open(to, SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE));
  sqlite3_backup* backup =
      sqlite3_backup_init(copy->handle(), "main", from->handle(), "main");
  if (backup == nullptr) {
    return copy->StatusOf(sqlite3_errcode(copy->handle()), "begin a backup");
  }
  sqlite3_backup_step(backup, -1);
  const int code = sqlite3_backup_finish(backup);
  SELFCAL_RETURN_IF_ERROR(copy->StatusOf(code, "copy the database"));
  return copy->Execute("PRAGMA journal_mode = DELETE");
}

class SqliteCopies final : public DatabaseCopies {
 public:
  explicit SqliteCopies(std::string path) : path_(std::move(path)) {}

  absl::Status Export(const OnBytes& on_bytes) override {
    const Turn turn(&exports_);
    if (!turn.granted()) {
      return absl::ResourceExhaustedError(
          "other backups are being read: wait for their end");
    }
    SELFCAL_ASSIGN_OR_RETURN(std::ifstream file, OpenCopy());
    std::vector<char> piece(kPiece);
    while (file.read(piece.data(), kPiece), file.gcount() > 0) {
      if (!on_bytes({piece.data(), static_cast<std::size_t>(file.gcount())})) {
        return absl::CancelledError("the copy was not waited for");
      }
    }
    if (file.eof()) return absl::OkStatus();
    return Unreadable();
  }

  absl::StatusOr<std::unique_ptr<ArrivingCopy>> BeginImport() override {
    return BeginRestoration(path_, &restoring_);
  }

 private:
  // Copies to a file that is removed as soon as it is open, so that its reader
  // may take any time without holding up another.
  absl::StatusOr<std::ifstream> OpenCopy() {
    const std::lock_guard lock(copy_mutex_);
    const TemporaryDatabase copy(path_ + ".backup.new");
    SELFCAL_ASSIGN_OR_RETURN(const auto db,
                             SqliteConnection::OpenReader(path_));
    SELFCAL_RETURN_IF_ERROR(Copy(db.get(), copy.path()));
    std::ifstream file(copy.path(), std::ios::binary);
    if (!file) return Unreadable();
    return file;
  }

  static absl::Status Unreadable() {
    return absl::UnavailableError(
        "cannot read the copy of the database: check the disk and try again");
  }

  const std::string path_;
  std::mutex copy_mutex_;
  std::atomic<int> exports_ = 0;
  std::atomic<bool> restoring_ = false;
};

}  // namespace

std::unique_ptr<DatabaseCopies> MakeSqliteCopies(std::string path) {
  return std::make_unique<SqliteCopies>(std::move(path));
}

}  // namespace selfcal::server
