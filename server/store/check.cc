#include "server/store/check.h"

#include <fmt/format.h>

#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "server/status/status_macros.h"
#include "server/store/checksum.h"
#include "server/store/driver/statement.h"
#include "server/store/driver/transaction.h"
#include "server/store/payload.h"

namespace selfcal::server {
namespace {

// Findings of one check so far.
class Findings {
 public:
  explicit Findings(const StoreMaintenance::OnProblem& on_problem)
      : on_problem_(on_problem) {}

  void Add(std::string place, std::string description) {
    ++summary.problems;
    if (!cancelled_) {
      cancelled_ = !on_problem_({std::move(place), std::move(description)});
    }
  }
  bool cancelled() const { return cancelled_; }

  CheckSummary summary;

 private:
  const StoreMaintenance::OnProblem& on_problem_;
  bool cancelled_ = false;
};

// A blob with a column beside it that has its checksum.
struct Checked {
  std::string table;
  std::string blob;
};

std::vector<Checked> CheckedBlobs(Connection* db, Findings* findings) {
  const auto columns = db->Columns();
  if (!columns.ok()) {
    findings->Add("schema", std::string(columns.status().message()));
    return {};
  }
  std::set<std::string> with_checksum;
  for (const Column& column : *columns) {
    if (column.name == "sha256" && column.type == db->dialect().blob_type) {
      with_checksum.insert(column.table);
    }
  }
  std::vector<Checked> checked;
  for (const Column& column : *columns) {
    if (with_checksum.contains(column.table) && column.name != "sha256" &&
        column.type == db->dialect().blob_type) {
      checked.push_back({column.table, column.name});
    }
  }
  return checked;
}

void CheckBlobs(Connection* db, const Checked& what, Findings* findings) {
  Statement read(
      db, fmt::format("SELECT {}, sha256 FROM {}", what.blob, what.table));
  for (std::int64_t row = 1; !findings->cancelled() && read.Next(); ++row) {
    ++findings->summary.checksums;
    if (Sha256(read.Text(0)) != read.Text(1)) {
      findings->Add(fmt::format("{}, {} of row {}", what.table, what.blob, row),
                    "its checksum does not match");
    }
  }
  if (!read.status().ok()) {
    findings->Add(what.table, std::string(read.status().message()));
  }
}

void CheckPayloads(Connection* db, Findings* findings) {
  Statement read(db, "SELECT data, raw_bytes, sha256 FROM payloads");
  for (std::int64_t row = 1; !findings->cancelled() && read.Next(); ++row) {
    ++findings->summary.payloads;
    const std::string what =
        fmt::format("the data of the segment in row {}", row);
    const Payload payload{read.Text(0), read.Int(1), read.Text(2)};
    const absl::Status status = UnpackSegment(payload, what).status();
    if (!status.ok()) findings->Add(what, std::string(status.message()));
  }
  if (!read.status().ok()) {
    findings->Add("payloads", std::string(read.status().message()));
  }
}

// What the program relies on and no constraint of the schema states. `sql`
// selects the places that break the rule, in a backup of an older schema as
// well.
struct Rule {
  std::string_view sql;
  std::string_view description;
};

constexpr Rule kRules[] = {
    {"SELECT 'rig ' || r.id FROM rigs r WHERE 1 <> (SELECT count(*) "
     "FROM calibrations c WHERE c.rig = r.rig AND c.state = 1)",
     "does not have one active calibration"},
    {"SELECT 'rig ' || r.id FROM rigs r WHERE NOT EXISTS (SELECT 1 "
     "FROM calibrations c WHERE c.rig = r.rig AND c.version = 1)",
     "has no factory calibration"},
    {"SELECT 'rig ' || r.id || ', table ' || t.group_name FROM tables t "
     "JOIN rigs r ON r.rig = t.rig WHERE t.capacity < (SELECT count(*) "
     "FROM table_entries e WHERE e.rig = t.rig "
     "AND e.group_name = t.group_name)",
     "holds more segments than its capacity"},
    // By the key of a segment, whichever it is.
    {"SELECT 'rig ' || r.id || ', table ' || e.group_name || ', segment ' || "
     "coalesce(s.session || '~' || s.session_index, '?') "
     "FROM table_entries e NATURAL LEFT JOIN segments s "
     "JOIN rigs r ON r.rig = e.rig WHERE coalesce(s.state, 0) <> 2",
     "is not a scored segment of this rig"},
};

void CheckRule(Connection* db, const Rule& rule, Findings* findings) {
  Statement read(db, rule.sql);
  while (!findings->cancelled() && read.Next()) {
    findings->Add(read.Text(0), std::string(rule.description));
  }
  if (!read.status().ok()) {
    findings->Add("records", std::string(read.status().message()));
  }
}

}  // namespace

absl::StatusOr<CheckSummary> CheckDatabase(
    Connection* db, const StoreMaintenance::OnProblem& on_problem) {
  const Snapshot snapshot(db);
  SELFCAL_RETURN_IF_ERROR(snapshot.status());
  Findings findings(on_problem);
  findings.summary.bytes = db->Size().value_or(DatabaseSize()).bytes;
  db->CheckStructure([&](const StoreProblem& problem) {
    findings.Add(problem.place, problem.description);
    return !findings.cancelled();
  });
  for (const Checked& what : CheckedBlobs(db, &findings)) {
    CheckBlobs(db, what, &findings);
  }
  CheckPayloads(db, &findings);
  for (const Rule& rule : kRules) CheckRule(db, rule, &findings);
  if (findings.cancelled()) {
    return absl::CancelledError("the check was not waited for");
  }
  return findings.summary;
}

}  // namespace selfcal::server
