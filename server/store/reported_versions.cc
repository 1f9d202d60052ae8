#include "server/store/reported_versions.h"

#include <fmt/format.h>

#include <optional>
#include <string>

#include "server/status/status_macros.h"
#include "server/store/announcements.h"
#include "server/store/calibrations.h"
#include "server/store/driver/statement.h"
#include "server/store/estimates.h"
#include "server/store/report_check.h"

namespace selfcal::server {
namespace {

// The value of the column state.
std::int64_t Number(CalibrationState state) {
  return static_cast<std::int64_t>(state);
}

absl::Status SetState(UnitOfWork* tx,
                      std::int64_t version,
                      CalibrationState state) {
  return Statement(tx->db(),
                   "UPDATE calibrations SET state = ?3 "
                   "WHERE rig = ?1 AND version = ?2 AND state <> ?3",
                   tx->rig_row(),
                   version,
                   Number(state))
      .Run();
}

// Inserts a version as it began; what became of it follows from activations.
absl::Status InsertVersion(UnitOfWork* tx,
                           std::int64_t version,
                           const ReportedRow& row,
                           const std::vector<ReportedRow>& rows) {
  std::optional<std::int64_t> run;
  if (row.Of("run").has_integer()) run = row.Of("run").integer();
  SELFCAL_RETURN_IF_ERROR(
      Statement(tx->db(),
                "INSERT INTO calibrations (rig, version, state, "
                "  create_time_ns, run, content, sha256, create_steady_ns) "
                "VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8)",
                tx->rig_row(),
                version,
                Number(version == 1 ? CalibrationState::kActive
                                    : CalibrationState::kCandidate),
                row.Of("create_time_ns").integer(),
                run,
                BlobView{row.Of("content").blob()},
                BlobView{row.Of("sha256").blob()},
                row.Of("create_steady_ns").integer())
          .Run());
  for (const ReportedRow& origin : rows) {
    if (origin.table->name != "calibration_segments") continue;
    SELFCAL_RETURN_IF_ERROR(WriteRow(tx, origin, version, OnConflict::kKeep));
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status ApplyCalibration(ReportApplication* to,
                              std::int64_t version,
                              const std::vector<ReportedRow>& rows) {
  UnitOfWork* const tx = to->tx;
  const ReportedRow* row = RowOf(rows, "calibrations");
  if (row == nullptr) return BadReport("a calibration is gone");
  Statement before(tx->db(),
                   "SELECT sha256, state FROM calibrations "
                   "WHERE rig = ?1 AND version = ?2",
                   tx->rig_row(),
                   version);
  const bool is_there = before.Next();
  SELFCAL_RETURN_IF_ERROR(before.status());
  if (!is_there) {
    SELFCAL_RETURN_IF_ERROR(InsertVersion(tx, version, *row, rows));
  } else if (before.Text(0) != row->Of("sha256").blob()) {
    return Contradiction(fmt::format("version {} differs", version));
  }
  const bool is_candidate =
      is_there ? before.Int(1) == Number(CalibrationState::kCandidate)
               : version != 1;
  if (is_candidate &&
      row->Of("state").integer() == Number(CalibrationState::kRejected)) {
    SELFCAL_RETURN_IF_ERROR(SetState(tx, version, CalibrationState::kRejected));
  }
  for (const ReportedRow& more : rows) {
    if (more.table->name != "validations" &&
        more.table->name != "disagreements") {
      continue;
    }
    SELFCAL_RETURN_IF_ERROR(WriteRow(tx, more, version, OnConflict::kKeep));
    if (more.table->name == "disagreements") {
      SELFCAL_RETURN_IF_ERROR(AnnounceCalibration(tx));
    }
  }
  SELFCAL_ASSIGN_OR_RETURN(const StoredCalibration written,
                           ReadCalibration(tx, version));
  SELFCAL_RETURN_IF_ERROR(ReadFactory(to));
  const std::string what = fmt::format("version {}", version);
  SELFCAL_RETURN_IF_ERROR(
      About(what, CheckReportedTime(written.create_time_ns)));
  SELFCAL_RETURN_IF_ERROR(About(what, CheckReported(written, *to->factory)));
  SELFCAL_RETURN_IF_ERROR(WriteListColumns(tx, written));
  return is_there ? absl::OkStatus() : InsertEstimates(tx, written);
}

absl::Status ApplyActivation(ReportApplication* to,
                             std::int64_t activation,
                             const std::vector<ReportedRow>& rows) {
  UnitOfWork* const tx = to->tx;
  const ReportedRow* row = RowOf(rows, "activations");
  if (row == nullptr) return BadReport("an activation is gone");
  SELFCAL_RETURN_IF_ERROR(
      About("an activation", CheckReportedTime(row->Of("time_ns").integer())));
  const std::int64_t version = row->Of("version").integer();
  Statement before(tx->db(),
                   "SELECT version FROM activations "
                   "WHERE rig = ?1 AND activation = ?2",
                   tx->rig_row(),
                   activation);
  const bool is_there = before.Next();
  SELFCAL_RETURN_IF_ERROR(before.status());
  if (is_there) {
    if (before.Int(0) == version) return absl::OkStatus();
    return Contradiction(fmt::format("activation {} differs", activation));
  }
  SELFCAL_ASSIGN_OR_RETURN(
      const std::int64_t newest,
      ReadInt(tx->db(),
              "SELECT coalesce(max(activation), 0) FROM activations "
              "WHERE rig = ?1",
              tx->rig_row()));
  if (activation != newest + 1) {
    return Contradiction(fmt::format("activation {} is missing", newest + 1));
  }
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t active, ActiveVersion(tx));
  if (active != version) {
    SELFCAL_RETURN_IF_ERROR(
        SetState(tx, active, to->rules.replaced(active, version)));
    SELFCAL_RETURN_IF_ERROR(SetState(tx, version, CalibrationState::kActive));
  }
  SELFCAL_RETURN_IF_ERROR(WriteRow(tx, *row, activation, OnConflict::kKeep));
  return AnnounceCalibration(tx);
}

}  // namespace selfcal::server
