#include "server/store/cohorts.h"

#include <fmt/format.h>

#include "server/status/status_macros.h"
#include "server/store/checksum.h"
#include "server/store/driver/statement.h"
#include "server/store/paging.h"

namespace selfcal::server {
namespace {

constexpr char kCohortColumns[] =
    "SELECT c.label, c.value, c.version, c.time_ns, c.content, c.sha256 "
    "FROM cohorts c ";

absl::StatusOr<std::vector<StoredCohort>> ReadCohorts(Statement* read) {
  std::vector<StoredCohort> cohorts;
  while (read->Next()) {
    StoredCohort& cohort = cohorts.emplace_back();
    cohort.label = read->Text(0);
    cohort.value = read->Text(1);
    cohort.version = read->Int(2);
    cohort.time_ns = read->Int(3);
    cohort.content = read->Text(4);
    SELFCAL_RETURN_IF_ERROR(
        VerifySha256(cohort.content,
                     read->Text(5),
                     fmt::format("version {} of the cohort {}={}",
                                 cohort.version,
                                 cohort.label,
                                 cohort.value)));
  }
  SELFCAL_RETURN_IF_ERROR(read->status());
  return cohorts;
}

absl::StatusOr<Listed<StoredCohort>> ListVersions(Connection* db,
                                                  const std::string& label,
                                                  const std::string& value,
                                                  const Page& page) {
  const std::string list = "cohorts/" + label + "=" + value;
  SELFCAL_ASSIGN_OR_RETURN(const auto before, PageNumber(list, page));
  const int size = PageSize(page);
  Statement read(db,
                 std::string(kCohortColumns) +
                     "WHERE c.label = ?1 AND c.value = ?2 AND c.version < ?3 "
                     "ORDER BY c.version DESC LIMIT ?4",
                 label,
                 value,
                 before.value_or(INT64_MAX),
                 size + 1);
  Listed<StoredCohort> listed;
  SELFCAL_ASSIGN_OR_RETURN(listed.items, ReadCohorts(&read));
  CutPage(
      list, size, [](const auto& item) { return item.version; }, &listed);
  return listed;
}

// The key of a page is LABEL=VALUE; a label has no '='.
absl::StatusOr<Listed<StoredCohort>> ListNewest(Connection* db,
                                                const Page& page) {
  constexpr std::string_view kList = "cohorts";
  SELFCAL_ASSIGN_OR_RETURN(const auto key, PageKey(kList, page));
  const std::string after = key.value_or("");
  const std::size_t sign = after.find('=');
  if (key && sign == after.npos) return BadPageToken();
  const std::string label = after.substr(0, sign);
  const std::string value = key ? after.substr(sign + 1) : "";
  const int size = PageSize(page);
  Statement read(db,
                 std::string(kCohortColumns) +
                     "WHERE (c.label, c.value) > (?1, ?2) AND c.version = "
                     "  (SELECT max(n.version) FROM cohorts n "
                     "   WHERE n.label = c.label AND n.value = c.value) "
                     "ORDER BY c.label, c.value LIMIT ?3",
                 label,
                 value,
                 size + 1);
  Listed<StoredCohort> listed;
  SELFCAL_ASSIGN_OR_RETURN(listed.items, ReadCohorts(&read));
  CutPage(
      kList,
      size,
      [](const auto& item) { return item.label + "=" + item.value; },
      &listed);
  return listed;
}

}  // namespace

absl::StatusOr<Listed<StoredCohort>> ListCohortRows(Connection* db,
                                                    const std::string& label,
                                                    const std::string& value,
                                                    const Page& page) {
  return label.empty() ? ListNewest(db, page)
                       : ListVersions(db, label, value, page);
}

absl::StatusOr<std::vector<std::string>> LabelValues(Connection* db,
                                                     const std::string& label) {
  Statement read(db,
                 "SELECT DISTINCT value FROM rig_labels WHERE name = ?1 "
                 "ORDER BY value",
                 label);
  std::vector<std::string> values;
  while (read.Next()) values.push_back(read.Text(0));
  SELFCAL_RETURN_IF_ERROR(read.status());
  return values;
}

absl::StatusOr<std::map<std::string, std::int64_t>> Outliers(Connection* db) {
  Statement read(db,
                 "SELECT r.id, o.version FROM cohort_outliers o "
                 "JOIN rigs r ON r.rig = o.rig");
  std::map<std::string, std::int64_t> outliers;
  while (read.Next()) outliers[read.Text(0)] = read.Int(1);
  SELFCAL_RETURN_IF_ERROR(read.status());
  return outliers;
}

absl::Status WriteOutlier(UnitOfWork* tx, std::int64_t version) {
  if (version == 0) {
    return Statement(tx->db(),
                     "DELETE FROM cohort_outliers WHERE rig = ?1",
                     tx->rig_row())
        .Run();
  }
  return Statement(tx->db(),
                   "INSERT INTO cohort_outliers (rig, version) "
                   "VALUES (?1, ?2) "
                   "ON CONFLICT (rig) DO UPDATE SET version = ?2",
                   tx->rig_row(),
                   version)
      .Run();
}

absl::StatusOr<std::int64_t> InsertCohort(Connection* db,
                                          const StoredCohort& cohort,
                                          std::int64_t kept) {
  const std::string sha256 = Sha256(cohort.content);
  SELFCAL_ASSIGN_OR_RETURN(
      const std::int64_t version,
      InsertReturning(db,
                      "INSERT INTO cohorts (label, value, version, time_ns, "
                      "  content, sha256) VALUES (?1, ?2, "
                      "  (SELECT coalesce(max(version), 0) + 1 FROM cohorts "
                      "   WHERE label = ?1 AND value = ?2), ?3, ?4, ?5) "
                      "ON CONFLICT DO NOTHING RETURNING version",
                      cohort.label,
                      cohort.value,
                      cohort.time_ns,
                      BlobView{cohort.content},
                      BlobView{sha256}));
  SELFCAL_RETURN_IF_ERROR(Statement(db,
                                    "DELETE FROM cohorts WHERE label = ?1 "
                                    "  AND value = ?2 AND version <= ?3",
                                    cohort.label,
                                    cohort.value,
                                    version - kept)
                              .Run());
  return version;
}

}  // namespace selfcal::server
