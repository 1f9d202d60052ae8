#include "server/store/maintenance.h"

#include <fmt/format.h>

#include <utility>

#include "server/status/status_macros.h"
#include "server/store/check.h"
#include "server/store/checksum.h"
#include "server/store/driver/driver.h"

namespace selfcal::server {
namespace {

absl::Status VerifyCopy(Connection* db) {
  std::string first;
  SELFCAL_ASSIGN_OR_RETURN(const CheckSummary summary,
                           CheckDatabase(db, [&](const StoreProblem& problem) {
                             if (first.empty())
                               first =
                                   problem.place + ": " + problem.description;
                             return true;
                           }));
  if (summary.problems == 0) return absl::OkStatus();
  return absl::DataLossError(
      fmt::format("{} problems, first {}", summary.problems, first));
}

class VerifiedRestoration final : public Restoration {
 public:
  explicit VerifiedRestoration(std::unique_ptr<ArrivingCopy> copy)
      : copy_(std::move(copy)) {}

  absl::Status Append(std::string_view bytes) override {
    digest_.Add(bytes);
    return copy_->Append(bytes);
  }

  absl::StatusOr<std::string> Finish(std::string_view sha256,
                                     std::int64_t time_ns) override {
    if (digest_.Finish() != sha256) {
      return absl::DataLossError(
          "the backup did not arrive as it was sent, or is not the one of its "
          "checksum: send it again");
    }
    auto previous = copy_->Finish(time_ns, VerifyCopy);
    if (!absl::IsDataLoss(previous.status())) return previous;
    return absl::DataLossError(fmt::format(
        "the backup is damaged and was not restored, use another: {}",
        std::string(previous.status().message())));
  }

 private:
  const std::unique_ptr<ArrivingCopy> copy_;
  Sha256Stream digest_;
};

class DatabaseMaintenance final : public StoreMaintenance {
 public:
  explicit DatabaseMaintenance(Database* database) : database_(database) {}

  absl::StatusOr<CheckSummary> Check(const OnProblem& on_problem) override {
    SELFCAL_ASSIGN_OR_RETURN(const auto db, database_->OpenReader());
    return CheckDatabase(db.get(), on_problem);
  }

  absl::StatusOr<BackupSummary> Backup(const OnBytes& on_bytes) override {
    SELFCAL_ASSIGN_OR_RETURN(DatabaseCopies* const copies, Copies());
    Sha256Stream digest;
    BackupSummary summary;
    SELFCAL_RETURN_IF_ERROR(copies->Export([&](std::string_view bytes) {
      digest.Add(bytes);
      summary.bytes += static_cast<std::int64_t>(bytes.size());
      return on_bytes(bytes);
    }));
    summary.sha256 = digest.Finish();
    return summary;
  }

  absl::StatusOr<std::unique_ptr<Restoration>> BeginRestore() override {
    SELFCAL_ASSIGN_OR_RETURN(DatabaseCopies* const copies, Copies());
    SELFCAL_ASSIGN_OR_RETURN(auto copy, copies->BeginImport());
    return std::make_unique<VerifiedRestoration>(std::move(copy));
  }

 private:
  absl::StatusOr<DatabaseCopies*> Copies() const {
    DatabaseCopies* const copies = database_->copies();
    if (copies != nullptr) return copies;
    return absl::UnimplementedError(
        "the database is that of a server: back it up and restore it with the "
        "tools of its engine");
  }

  Database* const database_;
};

}  // namespace

std::unique_ptr<StoreMaintenance> MakeMaintenance(Database* database) {
  return std::make_unique<DatabaseMaintenance>(database);
}

}  // namespace selfcal::server
