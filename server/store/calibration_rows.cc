#include "server/store/calibration_rows.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <optional>
#include <utility>

#include "server/status/status_macros.h"
#include "server/store/changed_since.h"
#include "server/store/checksum.h"
#include "server/store/driver/sql_condition.h"
#include "server/store/records.h"

namespace selfcal::server {
namespace {

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

}  // namespace

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

absl::Status ReadOrigins(Connection* db,
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

absl::StatusOr<StoredCalibration> ParseContent(const Statement& row,
                                               int content,
                                               const std::string& rig,
                                               std::int64_t version,
                                               CalibrationParser parse) {
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

absl::StatusOr<StoredCalibration> CalibrationFromRow(const Statement& row,
                                                     CalibrationParser parse) {
  const std::int64_t version = row.Int(0);
  const std::int64_t rig_id = row.Int(11);
  const std::string rig = row.Text(12);
  SELFCAL_ASSIGN_OR_RETURN(StoredCalibration calibration,
                           ParseContent(row, 4, rig, version, parse));
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

}  // namespace selfcal::server
