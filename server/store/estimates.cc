#include "server/store/estimates.h"

#include <absl/strings/numbers.h>
#include <absl/strings/str_split.h>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

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
// component (?4), or of all.
const char* ConditionOf(const EstimateQuery& query) {
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

struct FoundEstimate {
  EstimatePlace place;
  StoredEstimate estimate;
};

// Adds those that follow the place to *found, until it has `limit`: of these
// rigs or, if none is named, of all.
absl::Status ReadEstimates(Connection* db,
                           const EstimateQuery& query,
                           const std::vector<std::int64_t>& rigs,
                           const EstimatePlace& place,
                           std::size_t limit,
                           std::vector<FoundEstimate>* found) {
  Statement read(
      db,
      rigs.empty() ? Reuse::kKept : Reuse::kOnce,
      fmt::format(
          "SELECT r.id, e.version, c.create_time_ns, c.state, "
          "  e.component, e.unit, e.value, e.sigma, e.from_factory, e.rig "
          "FROM estimates e "
          "JOIN calibrations c ON c.rig = e.rig AND c.version = e.version "
          "JOIN rigs r ON r.rig = e.rig "
          "WHERE {} AND {} {} "
          "ORDER BY e.rig, e.version, e.component LIMIT ?5",
          ConditionOf(query),
          rigs.empty() ? "c.rig >= ?1 AND r.rig >= ?1"
                       : fmt::format("e.rig IN ({0}) AND c.rig IN ({0})",
                                     fmt::join(rigs, ", ")),
          query.only_active ? "AND c.state = 1" : ""),
      place.rig,
      place.version,
      place.component,
      query.component,
      static_cast<std::int64_t>(limit - found->size()));
  while (read.Next()) {
    found->push_back({{read.Int(9), read.Int(1), read.Text(4)},
                      {read.Text(0),
                       read.Int(1),
                       read.Int(2),
                       static_cast<CalibrationState>(read.Int(3)),
                       read.Text(4),
                       read.Text(5),
                       read.Double(6),
                       IfThere(read, 7),
                       IfThere(read, 8)}});
  }
  return read.status();
}

// The keys of the first rigs of the query from this one on, ascending.
absl::StatusOr<std::vector<std::int64_t>> RigsFrom(Connection* db,
                                                   const RigQuery& query,
                                                   std::int64_t first,
                                                   int limit) {
  SqlCondition condition(3);
  AddRigConditions(query, "r", &condition, "?1");
  Statement read(db,
                 condition.reuse(),
                 fmt::format("SELECT r.rig FROM rigs r WHERE r.rig >= ?1 AND "
                             "{} ORDER BY r.rig LIMIT ?2",
                             condition.sql()),
                 first,
                 limit);
  condition.Bind(&read);
  std::vector<std::int64_t> rigs;
  while (read.Next()) rigs.push_back(read.Int(0));
  SELFCAL_RETURN_IF_ERROR(read.status());
  return rigs;
}

// The same for the rigs of the query: some at a time, each time twice as many.
// In one statement, planners may read those of all rigs that are left, since
// they do not know that conditions on the same key are of the same rigs.
absl::Status ReadEstimatesOfSome(Connection* db,
                                 const EstimateQuery& query,
                                 const EstimatePlace& place,
                                 std::size_t limit,
                                 std::vector<FoundEstimate>* found) {
  constexpr int kMostAtOnce = 5000;
  int at_once = static_cast<int>(limit);
  std::int64_t first = place.rig;
  for (;;) {
    SELFCAL_ASSIGN_OR_RETURN(const std::vector<std::int64_t> rigs,
                             RigsFrom(db, query.rigs, first, at_once));
    if (rigs.empty()) return absl::OkStatus();
    SELFCAL_RETURN_IF_ERROR(
        ReadEstimates(db, query, rigs, place, limit, found));
    const bool is_last = static_cast<int>(rigs.size()) < at_once;
    if (is_last || found->size() >= limit) return absl::OkStatus();
    first = rigs.back() + 1;
    at_once = std::min(2 * at_once, kMostAtOnce);
  }
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
  std::vector<FoundEstimate> found;
  if (!query.rigs.name.empty()) {
    SELFCAL_ASSIGN_OR_RETURN(place.rig, FindRigId(db, query.rigs.name));
  }
  SqlCondition some;
  AddRigConditions(query.rigs, "r", &some);
  SELFCAL_RETURN_IF_ERROR(
      some.is_empty()
          ? ReadEstimates(db, query, {}, place, size + 1, &found)
          : ReadEstimatesOfSome(db, query, place, size + 1, &found));
  Listed<StoredEstimate> listed;
  for (FoundEstimate& one : found) {
    if (listed.items.size() == size) {
      listed.next_token = MakePageToken(
          list,
          fmt::format("{} {} {}", place.rig, place.version, place.component));
      break;
    }
    place = std::move(one.place);
    listed.items.push_back(std::move(one.estimate));
  }
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
