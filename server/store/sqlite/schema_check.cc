#include "server/store/sqlite/schema_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "migrations/migrations.h"
#include "server/status/status_macros.h"
#include "server/store/driver/findings.h"
#include "server/store/driver/statement.h"
#include "server/store/sqlite/sqlite_connection.h"

namespace selfcal::server {
namespace {

std::vector<std::string> Describe(const std::vector<Column>& columns) {
  std::vector<std::string> descriptions;
  for (const Column& column : columns) {
    descriptions.push_back(fmt::format(
        "table {}, {} of type {}", column.table, column.name, column.type));
  }
  return descriptions;
}

// A table, an index, a trigger or a view.
struct SchemaObject {
  std::string type;
  std::string name;
  std::string sql;  // without what may differ between versions of SQLite

  std::string Name() const { return type + " " + name; }
};

// Leaves out quotes, and all but one of consecutive blanks.
std::string Normalised(const std::string& sql) {
  std::string normalised;
  for (const char c : sql) {
    const bool blank = std::isspace(static_cast<unsigned char>(c)) != 0;
    if (c == '"' || (blank && normalised.ends_with(' '))) continue;
    normalised += blank ? ' ' : c;
  }
  return normalised;
}

// sqlite_sequence is SQLite's own: it is there once a table had AUTOINCREMENT,
// but not in a copy by VACUUM from after that table was dropped.
absl::StatusOr<std::vector<SchemaObject>> ReadObjects(SqliteConnection* db) {
  Statement read(db,
                 "SELECT type, name, sql FROM sqlite_schema "
                 "WHERE sql IS NOT NULL "
                 "AND name NOT IN ('schema_migrations', 'sqlite_sequence') "
                 "ORDER BY type, name");
  std::vector<SchemaObject> objects;
  while (read.Next()) {
    objects.push_back({read.Text(0), read.Text(1), Normalised(read.Text(2))});
  }
  SELFCAL_RETURN_IF_ERROR(read.status());
  return objects;
}

const SchemaObject* Find(const std::vector<SchemaObject>& objects,
                         const SchemaObject& wanted) {
  const auto found =
      std::find_if(objects.begin(), objects.end(), [&](const auto& object) {
        return object.type == wanted.type && object.name == wanted.name;
      });
  return found == objects.end() ? nullptr : &*found;
}

// What the migrations up to `version` create in an empty database.
absl::StatusOr<std::unique_ptr<SqliteConnection>> Expected(
    std::int64_t version) {
  SELFCAL_ASSIGN_OR_RETURN(
      auto empty,
      SqliteConnection::Open(":memory:",
                             SQLITE_OPEN_READWRITE | SQLITE_OPEN_MEMORY));
  for (const Migration& migration : SqliteMigrations()) {
    if (version-- <= 0) break;
    SELFCAL_RETURN_IF_ERROR(empty->Execute(std::string(migration.sql)));
  }
  return empty;
}

// Reports columns that are missing, and their tables in *incomplete.
absl::Status CompareColumns(SqliteConnection* db,
                            SqliteConnection* expected,
                            Findings* findings,
                            std::set<std::string>* incomplete) {
  SELFCAL_ASSIGN_OR_RETURN(const auto found, db->Columns());
  SELFCAL_ASSIGN_OR_RETURN(const auto columns, expected->Columns());
  const std::vector<std::string> there = Describe(found);
  const std::vector<std::string> wanted = Describe(columns);
  for (std::size_t i = 0; i < columns.size(); ++i) {
    if (std::find(there.begin(), there.end(), wanted[i]) != there.end()) {
      continue;
    }
    findings->Add("schema", wanted[i] + " is not there");
    incomplete->insert(columns[i].table);
  }
  return absl::OkStatus();
}

// Without its triggers and indexes, a database accepts what must never be in
// it, such as a second active calibration.
absl::Status CompareObjects(SqliteConnection* db,
                            SqliteConnection* expected,
                            const std::set<std::string>& incomplete,
                            Findings* findings) {
  SELFCAL_ASSIGN_OR_RETURN(const auto found, ReadObjects(db));
  SELFCAL_ASSIGN_OR_RETURN(const auto wanted, ReadObjects(expected));
  for (const SchemaObject& object : wanted) {
    if (object.type == "table" && incomplete.contains(object.name)) continue;
    const SchemaObject* there = Find(found, object);
    if (there == nullptr) {
      findings->Add("schema", object.Name() + " is not there");
    } else if (there->sql != object.sql) {
      findings->Add("schema", object.Name() + " is not that of this program");
    }
  }
  for (const SchemaObject& object : found) {
    if (Find(wanted, object) == nullptr) {
      findings->Add("schema", object.Name() + " does not belong there");
    }
  }
  return absl::OkStatus();
}

// Compares the schema with that of the migrations. SQLite itself does not
// notice a damaged name, which hides its contents.
absl::Status CompareSchema(SqliteConnection* db, Findings* findings) {
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t version,
                           ReadInt(db, "PRAGMA user_version"));
  SELFCAL_ASSIGN_OR_RETURN(const auto expected, Expected(version));
  std::set<std::string> incomplete;
  SELFCAL_RETURN_IF_ERROR(
      CompareColumns(db, expected.get(), findings, &incomplete));
  return CompareObjects(db, expected.get(), incomplete, findings);
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
  findings.AddUnlessOk("schema", CompareSchema(db, &findings));
  CheckPages(db, &findings);
  CheckReferences(db, &findings);
}

}  // namespace selfcal::server
