#include "server/store/sqlite/sqlite_writer.h"

#include <algorithm>
#include <utility>

#include "server/status/status_macros.h"
#include "server/store/driver/statement.h"

namespace selfcal::server {
namespace {

// The log is moved into the file when it is this large: several groups of
// segments, so that a page that many of them change is written once.
constexpr std::int64_t kCheckpointBytes = 32 << 20;
constexpr std::int64_t kLeastPage = 512;  // the smallest of SQLite

// Replaces SQLite's automatic checkpoint, which is part of a commit.
int NoteLogPages(void* log_pages, sqlite3*, const char*, int pages) {
  *static_cast<int*>(log_pages) = pages;
  return SQLITE_OK;
}

}  // namespace

SqliteWriter::SqliteWriter(std::string path, Opener open)
    : path_(std::move(path)), open_(std::move(open)) {}

absl::Status SqliteWriter::Open() {
  connection_.reset();
  SELFCAL_ASSIGN_OR_RETURN(connection_, open_());
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t page_bytes,
                           ReadInt(connection_.get(), "PRAGMA page_size"));
  checkpoint_pages_ = kCheckpointBytes / std::max(page_bytes, kLeastPage);
  SELFCAL_ASSIGN_OR_RETURN(file_, IdentityOf(path_));
  log_.reset();
  log_pages_ = 0;
  sqlite3_wal_hook(connection_->handle(), NoteLogPages, &log_pages_);
  return absl::OkStatus();
}

bool SqliteWriter::IsInPlace() {
  const std::string log = path_ + "-wal";
  if (!log_) {
    const auto first = IdentityOf(log);
    if (first.ok()) log_ = *first;
  }
  return StillNames(path_, file_) && log_ && StillNames(log, *log_);
}

absl::Status SqliteWriter::CheckpointIfLarge() {
  if (log_pages_ < checkpoint_pages_) return absl::OkStatus();
  log_pages_ = 0;  // until the next commit
  // As far as readers allow; the rest next time.
  const int code = sqlite3_wal_checkpoint_v2(connection_->handle(),
                                             nullptr,
                                             SQLITE_CHECKPOINT_PASSIVE,
                                             nullptr,
                                             nullptr);
  if (code == SQLITE_BUSY) return absl::OkStatus();
  return connection_->StatusOf(code, "checkpoint");
}

}  // namespace selfcal::server
