#include "server/store/calibrations.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <map>
#include <string_view>
#include <utility>

#include "server/status/status_macros.h"
#include "server/store/changed_since.h"
#include "server/store/checksum.h"
#include "server/store/driver/statement.h"
#include "server/store/paging.h"
#include "server/store/records.h"
#include "server/store/rig_lists.h"
#include "server/store/rigs.h"
#include "server/store/time_place.h"

namespace selfcal::server {
namespace {

std::string SelectCalibrations() {
  return fmt::format(
      "SELECT c.version, c.state, c.create_time_ns, c.run, c.content, "
      "  c.sha256, v.content, v.sha256, "
      "  (SELECT coalesce(max(a.activation), 0) FROM activations a "
      "   WHERE a.rig = c.rig AND a.version = c.version), "
      "  (SELECT coalesce(max(d.finding), '') FROM disagreements d "
      "   WHERE d.rig = c.rig AND d.version = c.version), "
      "  c.create_steady_ns, c.rig, g.id, {} "
      "FROM calibrations c JOIN rigs g ON g.rig = c.rig "
      "LEFT JOIN validations v ON v.rig = c.rig AND v.version = c.version ",
      kChangedSince);
}

void Include(double temperature_c,
             std::optional<SegmentTemperatures>* temperatures) {
  if (!*temperatures) {
    *temperatures = {1, temperature_c, temperature_c, temperature_c};
    return;
  }
  SegmentTemperatures& all = **temperatures;
  ++all.segments;
  all.mean_c += (temperature_c - all.mean_c) / all.segments;
  all.min_c = std::min(all.min_c, temperature_c);
  all.max_c = std::max(all.max_c, temperature_c);
}

// Reads the segments of the versions, with their temperatures.
absl::Status ReadSegments(Connection* db,
                          std::vector<StoredCalibration>* calibrations) {
  if (calibrations->empty()) return absl::OkStatus();
  std::map<std::pair<std::int64_t, std::int64_t>, StoredCalibration*> by_key;
  std::vector<std::vector<SqlCondition::Value>> keys;
  for (StoredCalibration& calibration : *calibrations) {
    by_key[{calibration.rig_key, calibration.version}] = &calibration;
    keys.push_back({calibration.rig_key, calibration.version});
  }
  SqlCondition condition;
  condition.AndIn("(c.rig, c.version)", keys);
  Statement read(db,
                 condition.reuse(),
                 "SELECT c.rig, c.version, s.session, s.session_index, "
                 "  s.temperature_c FROM calibration_segments c "
                 "CROSS JOIN segments s "
                 "WHERE s.rig = c.rig AND s.sequence = c.sequence AND " +
                     condition.sql() +
                     " ORDER BY c.rig, c.version, c.sequence");
  condition.Bind(&read);
  while (read.Next()) {
    StoredCalibration* calibration = by_key.at({read.Int(0), read.Int(1)});
    calibration->segments.push_back({read.Text(2), read.Int(3)});
    if (!read.IsNull(4)) Include(read.Double(4), &calibration->temperatures);
  }
  return read.status();
}

using Parser = absl::StatusOr<StoredCalibration> (*)(std::string_view,
                                                     const std::string&);

// The record of the version, from its bytes and their checksum in these
// columns.
absl::StatusOr<StoredCalibration> ParseColumns(const Statement& row,
                                               int content,
                                               const std::string& rig,
                                               std::int64_t version,
                                               Parser parse) {
  const std::string what =
      fmt::format("calibration {} of rig {}", version, rig);
  const std::string bytes = row.Text(content);
  SELFCAL_RETURN_IF_ERROR(VerifySha256(bytes, row.Text(content + 1), what));
  SELFCAL_ASSIGN_OR_RETURN(StoredCalibration calibration, parse(bytes, what));
  if (calibration.rig != rig || calibration.version != version) {
    return absl::DataLossError(fmt::format(
        "{} holds the content of another version; restore a backup", what));
  }
  return calibration;
}

// Reads all but the segments.
absl::StatusOr<StoredCalibration> CalibrationFromRow(
    const Statement& row, Parser parse = ParseCalibration) {
  const std::int64_t version = row.Int(0);
  const std::int64_t rig_id = row.Int(11);
  const std::string rig = row.Text(12);
  SELFCAL_ASSIGN_OR_RETURN(StoredCalibration calibration,
                           ParseColumns(row, 4, rig, version, parse));
  calibration.rig_key = rig_id;
  calibration.state = static_cast<CalibrationState>(row.Int(1));
  calibration.create_time_ns = row.Int(2);
  if (!row.IsNull(3)) {
    calibration.run = row.Int(3);
  }
  if (!row.IsNull(6)) {
    const std::string what =
        fmt::format("calibration {} of rig {}", version, rig);
    const std::string validation = row.Text(6);
    SELFCAL_RETURN_IF_ERROR(
        VerifySha256(validation, row.Text(7), "the validation of " + what));
    SELFCAL_RETURN_IF_ERROR(ParseValidation(validation, what, &calibration));
  }
  calibration.activation = row.Int(8);
  calibration.finding = row.Text(9);
  calibration.create_steady_ns = row.Int(10);
  calibration.changed_since = row.Int(13);
  return calibration;
}

absl::StatusOr<StoredCalibration> ReportFromRow(const Statement& row) {
  return ParseColumns(row, 2, row.Text(1), row.Int(0), ParseReport);
}

absl::Status AddUnlessDamaged(absl::StatusOr<StoredCalibration> calibration,
                              std::vector<StoredCalibration>* calibrations) {
  if (absl::IsDataLoss(calibration.status())) return absl::OkStatus();
  SELFCAL_RETURN_IF_ERROR(calibration.status());
  calibrations->push_back(*std::move(calibration));
  return absl::OkStatus();
}

absl::StatusOr<std::int64_t> ActiveVersionOf(Connection* db, std::int64_t rig) {
  Statement read(
      db, "SELECT version FROM calibrations WHERE rig = ?1 AND state = 1", rig);
  const bool found = read.Next();
  SELFCAL_RETURN_IF_ERROR(read.status());
  if (!found) {
    return absl::DataLossError(
        "the rig has no active calibration; restore the database from a "
        "backup");
  }
  return read.Int(0);
}

// A version whose record is damaged is left out, as one must not hide those of
// all other rigs.
absl::StatusOr<Listed<StoredCalibration>> ListCalibrationsOfMany(
    Connection* db, const Page& page, const RigQuery& of) {
  const std::string list = "calibrations of many " + FilterText(of);
  SELFCAL_ASSIGN_OR_RETURN(TimePlace place, TimePlaceOf(list, page));
  const int size = PageSize(page);
  SqlCondition condition(5);
  AddRigConditions(of, "g", &condition);
  Statement read(db,
                 condition.reuse(),
                 SelectCalibrations() +
                     "WHERE (c.create_steady_ns, c.rig, c.version) < "
                     "  (?1, ?2, ?3) AND " +
                     condition.sql() +
                     " ORDER BY c.create_steady_ns DESC, c.rig DESC, "
                     "  c.version DESC LIMIT ?4",
                 place.steady_ns,
                 place.rig,
                 place.number,
                 size + 1);
  condition.Bind(&read);
  Listed<StoredCalibration> listed;
  for (int count = 0; read.Next(); ++count) {
    if (count == size) {
      listed.next_token = TokenAfter(list, place);
      break;
    }
    place = {read.Int(10), read.Int(11), read.Int(0)};
    SELFCAL_RETURN_IF_ERROR(AddUnlessDamaged(
        CalibrationFromRow(read, ParseWithoutSteps), &listed.items));
  }
  SELFCAL_RETURN_IF_ERROR(read.status());
  SELFCAL_RETURN_IF_ERROR(ReadSegments(db, &listed.items));
  return listed;
}

absl::Status NoSuchCalibration(const std::string& rig, std::int64_t version) {
  return absl::NotFoundError(
      fmt::format("rig {} has no calibration {}", rig, version));
}

}  // namespace

absl::StatusOr<std::vector<StoredCalibration>> ReadReports(
    Connection* db, const std::vector<VersionId>& versions) {
  std::vector<StoredCalibration> reports;
  if (versions.empty()) return reports;
  std::vector<std::vector<SqlCondition::Value>> ids;
  for (const auto& [rig, version] : versions) ids.push_back({rig, version});
  SqlCondition condition;
  condition.AndIn("(g.id, c.version)", ids);
  Statement read(db,
                 condition.reuse(),
                 "SELECT c.version, g.id, c.content, c.sha256 "
                 "FROM calibrations c JOIN rigs g ON g.rig = c.rig WHERE " +
                     condition.sql());
  condition.Bind(&read);
  while (read.Next()) {
    SELFCAL_RETURN_IF_ERROR(AddUnlessDamaged(ReportFromRow(read), &reports));
  }
  SELFCAL_RETURN_IF_ERROR(read.status());
  return reports;
}

absl::StatusOr<StoredCalibration> ReadCalibration(Connection* db,
                                                  const std::string& rig,
                                                  std::int64_t version) {
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t rig_id, FindRigId(db, rig));
  Statement read(db,
                 SelectCalibrations() + "WHERE c.rig = ?1 AND c.version = ?2",
                 rig_id,
                 version);
  const bool found = read.Next();
  SELFCAL_RETURN_IF_ERROR(read.status());
  if (!found) return NoSuchCalibration(rig, version);
  std::vector<StoredCalibration> one(1);
  SELFCAL_ASSIGN_OR_RETURN(one.front(), CalibrationFromRow(read));
  SELFCAL_RETURN_IF_ERROR(ReadSegments(db, &one));
  return std::move(one.front());
}

absl::StatusOr<StoredCalibration> ReadActiveCalibration(
    Connection* db, const std::string& rig) {
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t rig_id, FindRigId(db, rig));
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t version,
                           ActiveVersionOf(db, rig_id));
  return ReadCalibration(db, rig, version);
}

absl::StatusOr<bool> WasActive(Connection* db,
                               const std::string& rig,
                               std::int64_t version) {
  Statement read(db,
                 "SELECT EXISTS (SELECT 1 FROM activations a "
                 "  WHERE a.rig = c.rig AND a.version = c.version) "
                 "FROM calibrations c JOIN rigs r ON r.rig = c.rig "
                 "WHERE r.id = ?1 AND c.version = ?2",
                 rig,
                 version);
  if (read.Next()) return read.Int(0) != 0;
  SELFCAL_RETURN_IF_ERROR(read.status());
  return NoSuchCalibration(rig, version);
}

absl::StatusOr<Listed<StoredCalibration>> ListCalibrationRows(
    Connection* db,
    const std::string& rig,
    const Page& page,
    const RigQuery& of) {
  if (rig.empty()) return ListCalibrationsOfMany(db, page, of);
  const std::string list = "calibrations/" + rig;
  SELFCAL_ASSIGN_OR_RETURN(const auto before, PageNumber(list, page));
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t rig_id, FindRigId(db, rig));
  const int size = PageSize(page);
  Statement read(db,
                 SelectCalibrations() +
                     "WHERE c.rig = ?1 AND c.version < ?2 "
                     "ORDER BY c.version DESC LIMIT ?3",
                 rig_id,
                 before.value_or(INT64_MAX),
                 size + 1);
  Listed<StoredCalibration> listed;
  while (read.Next()) {
    SELFCAL_ASSIGN_OR_RETURN(StoredCalibration calibration,
                             CalibrationFromRow(read, ParseWithoutSteps));
    listed.items.push_back(std::move(calibration));
  }
  SELFCAL_RETURN_IF_ERROR(read.status());
  CutPage(
      list, size, [](const auto& item) { return item.version; }, &listed);
  SELFCAL_RETURN_IF_ERROR(ReadSegments(db, &listed.items));
  return listed;
}

absl::StatusOr<std::optional<std::int64_t>> CandidateOfRun(Connection* db,
                                                           std::int64_t rig,
                                                           std::int64_t run) {
  Statement read(db,
                 "SELECT version FROM calibrations "
                 "WHERE rig = ?1 AND run = ?2 AND state = 4",
                 rig,
                 run);
  std::optional<std::int64_t> version;
  if (read.Next()) {
    version = read.Int(0);
  }
  SELFCAL_RETURN_IF_ERROR(read.status());
  return version;
}

absl::StatusOr<StoredCalibration> CandidateCalibration(Connection* db,
                                                       const std::string& rig,
                                                       std::int64_t run) {
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t rig_id, FindRigId(db, rig));
  SELFCAL_ASSIGN_OR_RETURN(const auto version, CandidateOfRun(db, rig_id, run));
  if (!version) {
    return absl::NotFoundError(
        fmt::format("recalibration {} of rig {} has no candidate", run, rig));
  }
  return ReadCalibration(db, rig, *version);
}

absl::StatusOr<StoredCalibration> ReadCalibration(UnitOfWork* tx,
                                                  std::int64_t version) {
  return ReadCalibration(tx->db(), tx->rig(), version);
}

absl::StatusOr<StoredCalibration> ReadActiveCalibration(UnitOfWork* tx) {
  return ReadActiveCalibration(tx->db(), tx->rig());
}

absl::StatusOr<std::int64_t> ActiveVersion(UnitOfWork* tx) {
  return ActiveVersionOf(tx->db(), tx->rig_row());
}

absl::StatusOr<std::int64_t> NextVersion(UnitOfWork* tx) {
  return ReadInt(tx->db(),
                 "SELECT coalesce(max(version), 0) + 1 FROM calibrations "
                 "WHERE rig = ?1",
                 tx->rig_row());
}

absl::StatusOr<std::optional<std::int64_t>> CandidateOfRun(UnitOfWork* tx,
                                                           std::int64_t run) {
  return CandidateOfRun(tx->db(), tx->rig_row(), run);
}

absl::StatusOr<std::int64_t> ActivationSteadyTime(UnitOfWork* tx,
                                                  std::int64_t activation) {
  return ReadInt(tx->db(),
                 "SELECT steady_ns FROM activations "
                 "WHERE rig = ?1 AND activation = ?2",
                 tx->rig_row(),
                 activation);
}

absl::StatusOr<std::int64_t> SchemaVersion(UnitOfWork* tx) {
  return ReadInt(tx->db(), "SELECT max(version) FROM schema_migrations");
}

}  // namespace selfcal::server
