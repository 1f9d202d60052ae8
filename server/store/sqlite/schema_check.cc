#include "server/store/sqlite/schema_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "migrations/migrations.h"
#include "server/status/status_macros.h"
#include "server/store/driver/statement.h"
#include "server/store/sqlite/sqlite_connection.h"

namespace selfcal::server {
namespace {

class Findings {
 public:
  explicit Findings(const std::function<bool(const StoreProblem&)>& on_problem)
      : on_problem_(on_problem) {}

  void Add(std::string place, std::string description) {
    if (ended_) return;
    ended_ = !on_problem_({std::move(place), std::move(description)});
  }
  void AddUnlessOk(const std::string& place, const absl::Status& status) {
    if (!status.ok()) Add(place, std::string(status.message()));
  }
  bool ended() const { return ended_; }

 private:
  const std::function<bool(const StoreProblem&)>& on_problem_;
  bool ended_ = false;
};

std::vector<std::string> Describe(const std::vector<Column>& columns) {
  std::vector<std::string> descriptions;
  for (const Column& column : columns) {
    descriptions.push_back(fmt::format(
        "table {}, {} of type {}", column.table, column.name, column.type));
  }
  return descriptions;
}

// The columns that the migrations up to `version` create in an empty database.
absl::StatusOr<std::vector<Column>> ExpectedColumns(std::int64_t version) {
  SELFCAL_ASSIGN_OR_RETURN(
      const auto empty,
      SqliteConnection::Open(":memory:",
                             SQLITE_OPEN_READWRITE | SQLITE_OPEN_MEMORY));
  for (const Migration& migration : SqliteMigrations()) {
    if (version-- <= 0) break;
    SELFCAL_RETURN_IF_ERROR(empty->Execute(std::string(migration.sql)));
  }
  return empty->Columns();
}

// Verifies names: a damaged one hides its contents, and SQLite does not notice.
void CheckSchema(SqliteConnection* db, Findings* findings) {
  const auto version = ReadInt(db, "PRAGMA user_version");
  const auto found = db->Columns();
  const auto expected = ExpectedColumns(version.value_or(0));
  for (const auto& columns : {found, expected}) {
    if (columns.ok()) continue;
    return findings->AddUnlessOk("schema", columns.status());
  }
  const std::vector<std::string> there = Describe(*found);
  for (const std::string& column : Describe(*expected)) {
    if (std::find(there.begin(), there.end(), column) != there.end()) continue;
    findings->Add("schema", column + " is not there");
  }
}

// SQLite's own check of each page, record and index.
void CheckPages(SqliteConnection* db, Findings* findings) {
  Statement check(db, "PRAGMA integrity_check(100)");
  while (!findings->ended() && check.Next()) {
    if (check.Text(0) != "ok") findings->Add("database", check.Text(0));
  }
  findings->AddUnlessOk("database", check.status());
}

void CheckReferences(SqliteConnection* db, Findings* findings) {
  Statement check(db, "PRAGMA foreign_key_check");
  while (!findings->ended() && check.Next()) {
    findings->Add(fmt::format("{}, row {}", check.Text(0), check.Int(1)),
                  fmt::format("refers to {} that is not there", check.Text(2)));
  }
  findings->AddUnlessOk("database", check.status());
}

}  // namespace

void CheckSqliteStructure(
    SqliteConnection* db,
    const std::function<bool(const StoreProblem&)>& on_problem) {
  Findings findings(on_problem);
  CheckSchema(db, &findings);
  CheckPages(db, &findings);
  CheckReferences(db, &findings);
}

}  // namespace selfcal::server
