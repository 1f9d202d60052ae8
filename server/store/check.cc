#include "server/store/check.h"

#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "migrations/migrations.h"
#include "server/store/checksum.h"
#include "server/store/payload.h"
#include "server/store/status_macros.h"

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

std::int64_t Number(Connection* db, std::string_view sql) {
  Statement read(db, sql);
  return read.Next() ? read.Int(0) : 0;
}

// Columns of all tables with their types, in order.
absl::StatusOr<std::vector<std::string>> Columns(Connection* db) {
  Statement read(db,
                 "SELECT t.name, c.name, c.type FROM sqlite_schema t "
                 "JOIN pragma_table_info(t.name) c "
                 "WHERE t.type = 'table' AND t.name NOT LIKE 'sqlite%' "
                 "  AND t.name <> 'schema_migrations' "
                 "ORDER BY t.name, c.cid");
  std::vector<std::string> columns;
  while (read.Next()) {
    columns.push_back(fmt::format(
        "table {}, {} of type {}", read.Text(0), read.Text(1), read.Text(2)));
  }
  SELFCAL_RETURN_IF_ERROR(read.status());
  return columns;
}

// The columns that the migrations up to `version` create in an empty database.
absl::StatusOr<std::vector<std::string>> ExpectedColumns(std::int64_t version) {
  SELFCAL_ASSIGN_OR_RETURN(
      Connection empty,
      Connection::Open(":memory:", SQLITE_OPEN_READWRITE | SQLITE_OPEN_MEMORY));
  for (const Migration& migration : EmbeddedMigrations()) {
    if (version-- <= 0) break;
    SELFCAL_RETURN_IF_ERROR(empty.Execute(std::string(migration.sql)));
  }
  return Columns(&empty);
}

// Verifies names: a damaged one hides its contents, and SQLite does not notice.
void CheckSchema(Connection* db, Findings* findings) {
  const auto found = Columns(db);
  const auto expected = ExpectedColumns(Number(db, "PRAGMA user_version"));
  for (const auto& columns : {found, expected}) {
    if (columns.ok()) continue;
    findings->Add("schema", std::string(columns.status().message()));
    return;
  }
  for (const std::string& column : *expected) {
    if (std::find(found->begin(), found->end(), column) != found->end()) {
      continue;
    }
    findings->Add("schema", column + " is not there");
  }
}

// SQLite's own check of each page, record and index.
void CheckStructure(Connection* db, Findings* findings) {
  Statement check(db, "PRAGMA integrity_check(100)");
  while (!findings->cancelled() && check.Next()) {
    if (check.Text(0) != "ok") findings->Add("database", check.Text(0));
  }
  if (!check.status().ok()) {
    findings->Add("database", std::string(check.status().message()));
  }
}

void CheckReferences(Connection* db, Findings* findings) {
  Statement check(db, "PRAGMA foreign_key_check");
  while (!findings->cancelled() && check.Next()) {
    findings->Add(fmt::format("{}, row {}", check.Text(0), check.Int(1)),
                  fmt::format("refers to {} that is not there", check.Text(2)));
  }
  if (!check.status().ok()) {
    findings->Add("database", std::string(check.status().message()));
  }
}

// A blob with a column beside it that has its checksum.
struct Checked {
  std::string table;
  std::string blob;
};

std::vector<Checked> CheckedBlobs(Connection* db, Findings* findings) {
  Statement read(db,
                 "SELECT t.name, b.name FROM sqlite_schema t "
                 "JOIN pragma_table_info(t.name) h "
                 "  ON h.name = 'sha256' AND h.type = 'BLOB' "
                 "JOIN pragma_table_info(t.name) b "
                 "  ON b.name <> 'sha256' AND b.type = 'BLOB' "
                 "WHERE t.type = 'table' ORDER BY t.name");
  std::vector<Checked> checked;
  while (read.Next()) checked.push_back({read.Text(0), read.Text(1)});
  if (!read.status().ok()) {
    findings->Add("schema", std::string(read.status().message()));
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
  Statement read(db, "SELECT segment, data, raw_bytes, sha256 FROM payloads");
  while (!findings->cancelled() && read.Next()) {
    ++findings->summary.payloads;
    const std::string what = fmt::format("the data of segment {}", read.Int(0));
    const Payload payload{read.Text(1), read.Int(2), read.Text(3)};
    const absl::Status status = UnpackSegment(payload, what).status();
    if (!status.ok()) findings->Add(what, std::string(status.message()));
  }
  if (!read.status().ok()) {
    findings->Add("payloads", std::string(read.status().message()));
  }
}

}  // namespace

absl::StatusOr<CheckSummary> CheckDatabase(
    Connection* db, const StoreMaintenance::OnProblem& on_problem) {
  const Snapshot snapshot(db);
  SELFCAL_RETURN_IF_ERROR(snapshot.status());
  Findings findings(on_problem);
  findings.summary.bytes =
      Number(db, "PRAGMA page_count") * Number(db, "PRAGMA page_size");
  CheckSchema(db, &findings);
  CheckStructure(db, &findings);
  CheckReferences(db, &findings);
  for (const Checked& what : CheckedBlobs(db, &findings)) {
    CheckBlobs(db, what, &findings);
  }
  CheckPayloads(db, &findings);
  if (findings.cancelled()) {
    return absl::CancelledError("the check was not waited for");
  }
  return findings.summary;
}

}  // namespace selfcal::server
