#include "server/store/maintenance_sqlite.h"

#include <fmt/format.h>

#include <atomic>
#include <fstream>
#include <mutex>
#include <utility>
#include <vector>

#include "server/store/check.h"
#include "server/store/checksum.h"
#include "server/store/database_file.h"
#include "server/store/restore.h"
#include "server/store/statement.h"
#include "server/store/status_macros.h"

namespace selfcal::server {
namespace {

constexpr std::size_t kPiece = 1 << 20;

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

// Copies one state of `from` to a file that needs no log beside it.
absl::Status Copy(Connection* from, const std::string& to) {
  SELFCAL_RETURN_IF_ERROR(RemoveDatabaseFiles(to));
  SELFCAL_ASSIGN_OR_RETURN(
      Connection copy,
      Connection::Open(to, SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE));
  sqlite3_backup* backup =
      sqlite3_backup_init(copy.handle(), "main", from->handle(), "main");
  if (backup == nullptr) {
    return copy.StatusOf(sqlite3_errcode(copy.handle()), "begin a backup");
  }
  sqlite3_backup_step(backup, -1);
  const int code = sqlite3_backup_finish(backup);
  SELFCAL_RETURN_IF_ERROR(copy.StatusOf(code, "copy the database"));
  return copy.Execute("PRAGMA journal_mode = DELETE");
}

class SqliteMaintenance final : public StoreMaintenance {
 public:
  explicit SqliteMaintenance(std::string path) : path_(std::move(path)) {}

  absl::StatusOr<CheckSummary> Check(const OnProblem& on_problem) override {
    SELFCAL_ASSIGN_OR_RETURN(Connection db, OpenToRead());
    return CheckDatabase(&db, on_problem);
  }

  absl::StatusOr<BackupSummary> Backup(const OnBytes& on_bytes) override {
    const std::lock_guard lock(backup_mutex_);  // one copy at a time
    const TemporaryDatabase copy(path_ + ".backup.new");
    {
      SELFCAL_ASSIGN_OR_RETURN(Connection db, OpenToRead());
      SELFCAL_RETURN_IF_ERROR(Copy(&db, copy.path()));
    }
    std::ifstream file(copy.path(), std::ios::binary);
    std::vector<char> piece(kPiece);
    Sha256Stream digest;
    BackupSummary summary;
    while (file.read(piece.data(), kPiece), file.gcount() > 0) {
      const std::string_view bytes(piece.data(),
                                   static_cast<std::size_t>(file.gcount()));
      digest.Add(bytes);
      summary.bytes += file.gcount();
      if (!on_bytes(bytes)) {
        return absl::CancelledError("the backup was not waited for");
      }
    }
    if (!file.eof()) {
      return absl::UnavailableError(fmt::format(
          "cannot read {}: check the disk and try again", copy.path()));
    }
    summary.sha256 = digest.Finish();
    return summary;
  }

  absl::StatusOr<std::unique_ptr<Restoration>> BeginRestore() override {
    return BeginRestoration(path_, &restoring_);
  }

 private:
  absl::StatusOr<Connection> OpenToRead() const {
    SELFCAL_ASSIGN_OR_RETURN(Connection db,
                             Connection::Open(path_, SQLITE_OPEN_READONLY));
    SELFCAL_RETURN_IF_ERROR(
        db.Execute("PRAGMA busy_timeout = 5000;"
                   "PRAGMA trusted_schema = OFF;"
                   "PRAGMA cell_size_check = ON"));
    return db;
  }

  const std::string path_;
  std::mutex backup_mutex_;
  std::atomic<bool> restoring_ = false;
};

}  // namespace

std::unique_ptr<StoreMaintenance> MakeSqliteMaintenance(std::string path) {
  return std::make_unique<SqliteMaintenance>(std::move(path));
}

}  // namespace selfcal::server
