#include "server/store/estimates.h"

#include <absl/strings/numbers.h>
#include <absl/strings/str_split.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "core/model/calibration.h"
#include "server/status/status_macros.h"
#include "server/store/driver/statement.h"
#include "server/store/paging.h"
#include "server/store/rig_lists.h"
#include "server/store/rigs.h"

namespace selfcal::server {
namespace {

// The position after which a page begins.
struct EstimatePlace {
  std::int64_t rig = 0;  // its key
  std::int64_t version = 0;
  std::string component;
};

std::string ListOf(const EstimateQuery& query) {
  return fmt::format("estimates of {}{} with {}",
                     query.component,
                     query.only_active ? " active" : "",
                     FilterText(query.rigs));
}

absl::StatusOr<EstimatePlace> EstimatePlaceOf(const std::string& list,
                                              const Page& page) {
  SELFCAL_ASSIGN_OR_RETURN(const auto key, PageKey(list, page));
  EstimatePlace place;
  if (!key) return place;
  const std::vector<std::string> parts = absl::StrSplit(*key, ' ');
  if (parts.size() == 3 && absl::SimpleAtoi(parts[0], &place.rig) &&
      absl::SimpleAtoi(parts[1], &place.version)) {
    place.component = parts[2];
    return place;
  }
  return BadPageToken();
}

// The condition that finds the rows after ?1, ?2 and ?3 in an index: of one
// rig, of one component (?4), or of all.
const char* ConditionOf(const EstimateQuery& query) {
  if (!query.rigs.name.empty()) {
    return "e.rig = ?1 AND (e.version, e.component) > (?2, ?3) "
           "AND (?4 = '' OR e.component = ?4)";
  }
  if (query.component.empty()) {
    return "(e.rig, e.version, e.component) > (?1, ?2, ?3) AND ?4 = ''";
  }
  return "e.component = ?4 AND (e.rig, e.version) > (?1, ?2) "
         "AND CAST(?3 AS TEXT) IS NOT NULL";
}

std::optional<double> IfFinite(double value) {
  if (!std::isfinite(value)) return std::nullopt;
  return value;
}

std::optional<double> IfThere(const Statement& row, int column) {
  if (row.IsNull(column)) return std::nullopt;
  return row.Double(column);
}

}  // namespace

absl::Status InsertEstimates(UnitOfWork* tx,
                             const StoredCalibration& calibration) {
  const Calibration& theta = calibration.theta;
  SELFCAL_ASSIGN_OR_RETURN(const StoredRig rig, ReadRig(tx));
  const auto components = TangentComponents(theta);
  const Eigen::VectorXd values = ReadableValues(theta);
  const auto size = static_cast<Eigen::Index>(components.size());
  const Eigen::MatrixXd& Sigma = calibration.covariance;
  const bool has_covariance = Sigma.rows() == size && Sigma.cols() == size;
  const bool has_factory = SameShape(theta, rig.rig.factory);
  const Eigen::VectorXd differences =
      has_factory ? BoxMinus(theta, rig.rig.factory) : Eigen::VectorXd();
  for (Eigen::Index i = 0; i < size; ++i) {
    if (!std::isfinite(values[i])) continue;
    std::optional<double> sigma;
    if (has_covariance) sigma = IfFinite(std::sqrt(Sigma(i, i)));
    std::optional<double> difference;
    if (has_factory) difference = IfFinite(differences[i]);
    SELFCAL_RETURN_IF_ERROR(
        Statement(tx->db(),
                  "INSERT INTO estimates (rig, version, component, unit, "
                  "  value, sigma, from_factory) "
                  "VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7) "
                  "ON CONFLICT (rig, version, component) DO UPDATE SET "
                  "  unit = ?4, value = ?5, sigma = ?6, from_factory = ?7",
                  tx->rig_row(),
                  calibration.version,
                  components[i].name,
                  components[i].unit,
                  values[i],
                  sigma,
                  difference)
            .Run());
  }
  return absl::OkStatus();
}

absl::StatusOr<Listed<StoredEstimate>> ListEstimateRows(
    Connection* db, const EstimateQuery& query, const Page& page) {
  const std::string list = ListOf(query);
  SELFCAL_ASSIGN_OR_RETURN(EstimatePlace place, EstimatePlaceOf(list, page));
  const auto size = static_cast<std::size_t>(PageSize(page));
  if (!query.rigs.name.empty()) {
    SELFCAL_ASSIGN_OR_RETURN(place.rig, FindRigId(db, query.rigs.name));
  }
  SqlCondition condition(6);
  AddRigConditions(query.rigs, "r", &condition, "?1");
  Statement read(
      db,
      condition.reuse(),
      fmt::format("SELECT r.id, e.version, c.create_time_ns, c.state, "
                  "  e.component, e.unit, e.value, e.sigma, e.from_factory, "
                  "  e.rig "
                  "FROM estimates e "
                  "JOIN calibrations c ON c.rig = e.rig "
                  "  AND c.version = e.version "
                  "JOIN rigs r ON r.rig = e.rig "
                  "WHERE {} AND c.rig >= ?1 AND r.rig >= ?1 AND {} {} "
                  "ORDER BY e.rig, e.version, e.component LIMIT ?5",
                  ConditionOf(query),
                  condition.sql(),
                  query.only_active ? "AND c.state = 1" : ""),
      place.rig,
      place.version,
      place.component,
      query.component,
      static_cast<std::int64_t>(size + 1));
  condition.Bind(&read);
  Listed<StoredEstimate> listed;
  while (read.Next()) {
    if (listed.items.size() == size) {
      listed.next_token = MakePageToken(
          list,
          fmt::format("{} {} {}", place.rig, place.version, place.component));
      break;
    }
    place = {read.Int(9), read.Int(1), read.Text(4)};
    listed.items.push_back({read.Text(0),
                            read.Int(1),
                            read.Int(2),
                            static_cast<CalibrationState>(read.Int(3)),
                            read.Text(4),
                            read.Text(5),
                            read.Double(6),
                            IfThere(read, 7),
                            IfThere(read, 8)});
  }
  SELFCAL_RETURN_IF_ERROR(read.status());
  return listed;
}

absl::StatusOr<std::vector<VersionId>> VersionsWithoutEstimates(Connection* db,
                                                                int limit) {
  Statement read(db,
                 "SELECT r.id, c.version FROM calibrations c "
                 "JOIN rigs r ON r.rig = c.rig WHERE NOT EXISTS "
                 "  (SELECT 1 FROM estimates e WHERE e.rig = c.rig "
                 "   AND e.version = c.version) "
                 "ORDER BY c.rig, c.version LIMIT ?1",
                 limit);
  std::vector<VersionId> versions;
  while (read.Next()) versions.emplace_back(read.Text(0), read.Int(1));
  SELFCAL_RETURN_IF_ERROR(read.status());
  return versions;
}

}  // namespace selfcal::server
