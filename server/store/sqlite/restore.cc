#include "server/store/sqlite/restore.h"

#include <fmt/format.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <optional>
#include <system_error>
#include <utility>

#include "migrations/migrations.h"
#include "server/status/status_macros.h"
#include "server/store/sqlite/database_file.h"
#include "server/store/sqlite/open_database.h"
#include "server/store/sqlite/sqlite_connection.h"

namespace selfcal::server {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kWaiting = ".restore-";
constexpr std::string_view kBefore = ".before-restore-";

// The time in the name of the database that waits; nullopt if there is none.
absl::StatusOr<std::optional<std::string>> WaitingTime(
    const std::string& path) {
  const fs::path folder = fs::path(path).parent_path();
  const std::string prefix =
      fs::path(path).filename().string() + std::string(kWaiting);
  std::error_code error;
  fs::directory_iterator entries(folder.empty() ? "." : folder, error);
  if (error) return std::nullopt;  // opening the database reports it
  for (const fs::directory_entry& entry : entries) {
    const std::string name = entry.path().filename().string();
    if (!name.starts_with(prefix)) continue;
    const std::string time = name.substr(prefix.size());
    if (time.find_first_not_of("0123456789") == std::string::npos) return time;
  }
  return std::nullopt;
}

// The time in seconds for names of files, later if a database from before a
// restore has that name: none is ever overwritten.
std::string FreeTime(const std::string& path, std::int64_t time_ns) {
  constexpr std::int64_t kSecond = 1'000'000'000;
  std::int64_t time = time_ns / kSecond;
  std::error_code ignored;
  while (
      fs::exists(path + std::string(kBefore) + std::to_string(time), ignored)) {
    ++time;
  }
  return std::to_string(time);
}

absl::Status MoveIfThere(const std::string& from, const std::string& to) {
  std::error_code error;
  if (!fs::exists(from, error)) return absl::OkStatus();
  return RenameDurably(from, to);
}

// Opens a database that this program can use or migrate.
absl::StatusOr<std::unique_ptr<SqliteConnection>> OpenApart(
    const std::string& path) {
  SELFCAL_ASSIGN_OR_RETURN(const DatabaseFile file, InspectDatabaseFile(path));
  if (file == DatabaseFile::kAbsent) {
    return absl::DataLossError("no database arrived");
  }
  SELFCAL_ASSIGN_OR_RETURN(auto db,
                           SqliteConnection::Open(path, SQLITE_OPEN_READWRITE));
  SELFCAL_RETURN_IF_ERROR(VerifySchema(db.get(), path, SqliteMigrations()));
  return db;
}

absl::Status VerifyApart(const std::string& path,
                         const ArrivingCopy::Verify& verify) {
  const auto db = OpenApart(path);
  // The message would give advice about the database in use, which is intact.
  if (absl::IsDataLoss(db.status())) {
    return absl::DataLossError("it cannot be opened");
  }
  SELFCAL_RETURN_IF_ERROR(db.status());
  return verify(db->get());
}

class FileRestoration final : public ArrivingCopy {
 public:
  FileRestoration(std::string path, std::atomic<bool>* busy)
      : path_(std::move(path)),
        arriving_(path_ + ".restore.new"),
        busy_(busy) {}
  ~FileRestoration() override {
    file_.close();
    // The next restore replaces files that could not be removed.
    RemoveDatabaseFiles(arriving_).IgnoreError();
    *busy_ = false;
  }

  absl::Status Open() {
    SELFCAL_RETURN_IF_ERROR(RemoveDatabaseFiles(arriving_));
    file_.open(arriving_, std::ios::binary);
    return Written();
  }

  absl::Status Append(std::string_view bytes) override {
    file_.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    return Written();
  }

  absl::StatusOr<std::string> Finish(std::int64_t time_ns,
                                     const Verify& verify) override {
    file_.close();
    SELFCAL_RETURN_IF_ERROR(Written());
    SELFCAL_RETURN_IF_ERROR(VerifyApart(arriving_, verify));
    const std::string time = FreeTime(path_, time_ns);
    SELFCAL_RETURN_IF_ERROR(
        RenameDurably(arriving_, path_ + std::string(kWaiting) + time));
    return path_ + std::string(kBefore) + time;
  }

 private:
  absl::Status Written() const {
    if (file_.good()) return absl::OkStatus();
    return absl::ResourceExhaustedError(
        fmt::format("cannot write {}: free some space and try again; nothing "
                    "was changed",
                    arriving_));
  }

  const std::string path_;
  const std::string arriving_;
  std::atomic<bool>* const busy_;
  std::ofstream file_;
};

}  // namespace

absl::Status TakeOverRestored(const std::string& path) {
  SELFCAL_ASSIGN_OR_RETURN(const auto time, WaitingTime(path));
  if (!time) return absl::OkStatus();
  const std::string before = path + std::string(kBefore) + *time;
  // The log first: beside another database it would be lost.
  SELFCAL_RETURN_IF_ERROR(MoveIfThere(path + "-wal", before + "-wal"));
  SELFCAL_RETURN_IF_ERROR(MoveIfThere(path, before));
  std::error_code ignored;
  fs::remove(path + "-shm", ignored);  // SQLite creates it again
  return RenameDurably(path + std::string(kWaiting) + *time, path);
}

absl::StatusOr<std::unique_ptr<ArrivingCopy>> BeginRestoration(
    const std::string& path, std::atomic<bool>* busy) {
  if (busy->exchange(true)) {
    return absl::FailedPreconditionError(
        "another restore is under way: wait for its end");
  }
  auto restoration = std::make_unique<FileRestoration>(path, busy);
  SELFCAL_ASSIGN_OR_RETURN(const auto waiting, WaitingTime(path));
  if (waiting) {
    return absl::FailedPreconditionError(
        "a restored database waits already: restart the daemon first");
  }
  SELFCAL_RETURN_IF_ERROR(restoration->Open());
  return restoration;
}

}  // namespace selfcal::server
