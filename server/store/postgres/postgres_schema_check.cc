#include "server/store/postgres/postgres_schema_check.h"

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <fmt/format.h>

#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "migrations/migrations.h"
#include "server/status/status_macros.h"
#include "server/store/driver/findings.h"
#include "server/store/driver/statement.h"
#include "server/store/driver/transaction.h"
#include "server/store/postgres/postgres_connection.h"

namespace selfcal::server {
namespace {

// Everything in the current schema that a migration creates: a name for
// messages, and a definition.
constexpr char kObjects[] =
    "WITH tables AS (SELECT oid, relname FROM pg_class "
    "  WHERE relnamespace = current_schema()::regnamespace "
    "    AND relkind IN ('r', 'p') AND relname <> 'schema_migrations') "
    "SELECT format('table %s', relname), '' FROM tables "
    "UNION ALL SELECT format('column %s of table %s', a.attname, t.relname), "
    "    concat_ws(' ', format_type(a.atttypid, a.atttypmod), "
    "      (SELECT collname FROM pg_collation WHERE oid = a.attcollation), "
    "      CASE WHEN a.attnotnull THEN 'NOT NULL' END, "
    "      'identity', a.attidentity, "
    "      'default', pg_get_expr(d.adbin, d.adrelid)) "
    "  FROM tables t JOIN pg_attribute a ON a.attrelid = t.oid "
    "    AND a.attnum > 0 AND NOT a.attisdropped "
    "  LEFT JOIN pg_attrdef d ON d.adrelid = t.oid AND d.adnum = a.attnum "
    "UNION ALL SELECT format('constraint %s of table %s', c.conname, "
    "    t.relname), concat(pg_get_constraintdef(c.oid), c.convalidated) "
    "  FROM tables t JOIN pg_constraint c ON c.conrelid = t.oid "
    "UNION ALL SELECT format('index %s', i.relname), "
    "    concat(pg_get_indexdef(x.indexrelid), x.indisvalid) "
    "  FROM tables t JOIN pg_index x ON x.indrelid = t.oid "
    "  JOIN pg_class i ON i.oid = x.indexrelid "
    "UNION ALL SELECT format('trigger %s of table %s', g.tgname, t.relname), "
    "    concat(pg_get_triggerdef(g.oid), g.tgenabled) "
    "  FROM tables t JOIN pg_trigger g ON g.tgrelid = t.oid "
    "  WHERE NOT g.tgisinternal "
    "UNION ALL SELECT format('function %s', p.proname), "
    "    pg_get_functiondef(p.oid) FROM pg_proc p "
    "  WHERE p.pronamespace = current_schema()::regnamespace "
    "    AND p.prokind = 'f' "
    "UNION ALL SELECT format('view %s', v.relname), "
    "    concat(pg_get_viewdef(v.oid), v.reloptions) FROM pg_class v WHERE "
    "v.relkind IN ('v', 'm') "
    "    AND v.relnamespace = current_schema()::regnamespace";

// `text` without the name of the schema in front of other names.
std::string WithoutSchema(std::string text, const std::string& schema) {
  const std::string prefix = schema + ".";
  for (std::size_t at = text.find(prefix); at != std::string::npos;
       at = text.find(prefix, at)) {
    text.erase(at, prefix.size());
  }
  return text;
}

// Definitions of the objects in the current schema, by name.
absl::StatusOr<std::map<std::string, std::string>> ReadDefinitions(
    PostgresConnection* db) {
  std::string schema;
  {
    Statement read(db, "SELECT quote_ident(current_schema())");
    if (read.Next()) schema = read.Text(0);
    SELFCAL_RETURN_IF_ERROR(read.status());
  }
  Statement read(db, kObjects);
  std::map<std::string, std::string> definitions;
  while (read.Next()) {
    definitions[read.Text(0)] = WithoutSchema(read.Text(1), schema);
  }
  SELFCAL_RETURN_IF_ERROR(read.status());
  return definitions;
}

// What the migrations up to `version` create in an empty schema, which is
// rolled back.
absl::StatusOr<std::map<std::string, std::string>> ExpectedDefinitions(
    const std::string& uri, std::int64_t version) {
  SELFCAL_ASSIGN_OR_RETURN(const auto db, PostgresConnection::Open(uri));
  const Transaction transaction(db.get());
  SELFCAL_RETURN_IF_ERROR(transaction.status());
  SELFCAL_RETURN_IF_ERROR(
      db->Execute("CREATE SCHEMA selfcal_expected;"
                  "SET LOCAL search_path = selfcal_expected"));
  for (const Migration& migration : PostgresMigrations()) {
    if (version-- <= 0) break;
    SELFCAL_RETURN_IF_ERROR(db->Execute(std::string(migration.sql)));
  }
  return ReadDefinitions(db.get());
}

// Without its triggers and constraints, a database accepts what must never be
// in it, such as a second active calibration.
absl::Status CompareDefinitions(PostgresConnection* db, Findings* findings) {
  SELFCAL_ASSIGN_OR_RETURN(
      const std::int64_t version,
      ReadInt(db, "SELECT max(version) FROM schema_migrations"));
  SELFCAL_ASSIGN_OR_RETURN(const auto wanted,
                           ExpectedDefinitions(db->uri(), version));
  SELFCAL_ASSIGN_OR_RETURN(const auto found, ReadDefinitions(db));
  for (const auto& [name, definition] : wanted) {
    const auto there = found.find(name);
    if (there == found.end()) {
      findings->Add("schema", name + " is not there");
    } else if (there->second != definition) {
      findings->Add("schema", name + " is not that of this program");
    }
  }
  for (const auto& [name, definition] : found) {
    if (!wanted.contains(name)) {
      findings->Add("schema", name + " does not belong there");
    }
  }
  return absl::OkStatus();
}

// The queries that count the rows of a table whose reference leads nowhere, by
// table and referenced table. The engine prevents such rows unless its triggers
// were disabled.
constexpr char kReferences[] =
    "SELECT CAST(child.relname AS TEXT), CAST(parent.relname AS TEXT), "
    "  format('SELECT count(*) FROM %s c WHERE NOT EXISTS "
    "    (SELECT 1 FROM %s p WHERE %s) AND %s', "
    "    c.conrelid::regclass, c.confrelid::regclass, "
    "    string_agg(format('p.%I = c.%I', pa.attname, ca.attname), ' AND '), "
    "    string_agg(format('c.%I IS NOT NULL', ca.attname), ' AND ')) "
    "FROM pg_constraint c JOIN pg_class child ON child.oid = c.conrelid "
    "JOIN pg_class parent ON parent.oid = c.confrelid "
    "CROSS JOIN LATERAL unnest(c.conkey, c.confkey) AS k(child, parent) "
    "JOIN pg_attribute ca ON ca.attrelid = c.conrelid "
    "  AND ca.attnum = k.child "
    "JOIN pg_attribute pa ON pa.attrelid = c.confrelid "
    "  AND pa.attnum = k.parent "
    "WHERE c.contype = 'f' "
    "  AND c.connamespace = current_schema()::regnamespace "
    "GROUP BY c.oid, c.conrelid, c.confrelid, child.relname, parent.relname "
    "ORDER BY 1, 2";

struct Reference {
  std::string table;
  std::string referenced;
  std::string count_broken;
};

absl::Status CheckReferences(PostgresConnection* db, Findings* findings) {
  std::vector<Reference> references;
  {
    Statement read(db, kReferences);
    while (read.Next()) {
      references.push_back({read.Text(0), read.Text(1), read.Text(2)});
    }
    SELFCAL_RETURN_IF_ERROR(read.status());
  }
  for (const Reference& reference : references) {
    if (findings->ended()) break;
    SELFCAL_ASSIGN_OR_RETURN(const std::int64_t broken,
                             ReadInt(db, reference.count_broken));
    if (broken == 0) continue;
    findings->Add(reference.table,
                  fmt::format("{} rows refer to {} that are not there",
                              broken,
                              reference.referenced));
  }
  return absl::OkStatus();
}

}  // namespace

void CheckPostgresStructure(
    PostgresConnection* db,
    const std::function<bool(const StoreProblem&)>& on_problem) {
  Findings findings(on_problem);
  findings.AddUnlessOk("schema", CompareDefinitions(db, &findings));
  findings.AddUnlessOk("database", CheckReferences(db, &findings));
}

}  // namespace selfcal::server
