#include "test/server/store/postgres/postgres_engine.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <utility>
#include <vector>

#include "server/domain/clock.h"
#include "server/store/driver/statement.h"
#include "server/store/make_store.h"
#include "server/store/postgres/postgres.h"
#include "server/store/postgres/postgres_connection.h"
#include "test/server/store/postgres/postgres_cluster.h"
#include "test/support/eventually.h"

namespace selfcal::server {
namespace {

// The name of an empty database at the newest schema, to copy from.
const std::string& Template() {
  static const std::string name = [] {
    std::string created = "selfcal_template";
    SharedPostgres().Create(created);
    const auto opened = OpenPostgres(
        {.uri = SharedPostgres().Uri(created), .time_ns = NowNs()});
    EXPECT_TRUE(opened.ok()) << opened.status();
    return created;
  }();
  return name;
}

// A process that was killed leaves connections behind, on which the server
// carries out what it has begun.
void WaitForOthersToEnd(const std::string& database) {
  const auto connection =
      PostgresConnection::Open(SharedPostgres().Uri("template1"));
  if (!connection.ok()) return;
  EXPECT_TRUE(Eventually([&] {
    return ReadInt(connection->get(),
                   "SELECT count(*) FROM pg_stat_activity WHERE datname = ?1",
                   database)
               .value_or(1) == 0;
  })) << "other connections to "
      << database;
}

// Empties the tables, around the triggers that forbid it: faster than a new
// database.
void Empty(const std::string& database) {
  const auto connection =
      PostgresConnection::Open(SharedPostgres().Uri(database));
  ASSERT_TRUE(connection.ok()) << connection.status();
  const absl::Status emptied =
      (*connection)
          ->Execute(
              "SET session_replication_role = replica; "
              "DO $$ DECLARE relation RECORD; BEGIN "
              "  FOR relation IN SELECT relname, relkind FROM pg_class "
              "    WHERE relnamespace = 'public'::regnamespace "
              "      AND relkind IN ('r', 'S') "
              "      AND relname <> 'schema_migrations' LOOP "
              "    IF relation.relkind = 'S' THEN "
              "      EXECUTE format('ALTER SEQUENCE %I RESTART', "
              "                     relation.relname); "
              "    ELSE "
              "      EXECUTE format('DELETE FROM %I', relation.relname); "
              "    END IF; "
              "  END LOOP; "
              "END $$");
  ASSERT_TRUE(emptied.ok()) << emptied;
}

// The name of the folder's database, which a file in it contains.
std::string DatabaseOf(const TempFolder& folder) {
  struct Known {
    std::string name;
    std::string file;
  };
  static std::vector<Known> known;
  const std::string file = folder.File("database");
  std::string name;
  if (std::ifstream(file) >> name) return name;
  // One whose folder is gone serves again.
  const auto unused =
      std::find_if(known.begin(), known.end(), [](const Known& one) {
        return !std::filesystem::exists(one.file);
      });
  if (unused != known.end()) {
    name = unused->name;
    unused->file = file;
    WaitForOthersToEnd(name);
    Empty(name);
  } else {
    name = "test_" + std::to_string(getpid()) + "_" +
           std::to_string(known.size() + 1);
    known.push_back({name, file});
    SharedPostgres().Create(name, Template());
  }
  std::ofstream(file + ".new") << name << '\n';
  std::filesystem::rename(file + ".new", file);
  return name;
}

absl::StatusOr<std::unique_ptr<Database>> OpenShared(const TempFolder& folder) {
  return OpenPostgres({.uri = SharedPostgres().Uri(DatabaseOf(folder)),
                       .writers = 4,
                       .readers = 4,
                       .time_ns = NowNs()});
}

}  // namespace

PostgresCluster& SharedPostgres() {
  static PostgresCluster cluster;
  return cluster;
}

absl::StatusOr<std::unique_ptr<Database>> OpenPostgresDatabase(
    const TempFolder& folder) {
  WaitForOthersToEnd(DatabaseOf(folder));
  return OpenShared(folder);
}

absl::StatusOr<std::unique_ptr<Store>> OpenSharedPostgresStore(
    const TempFolder& folder) {
  auto database = OpenShared(folder);
  if (!database.ok()) return database.status();
  return MakeStore(*std::move(database));
}

absl::Status DamagePostgresColumn(const TempFolder& folder,
                                  const std::string& table,
                                  const std::string& column) {
  const auto connection =
      PostgresConnection::Open(SharedPostgres().Uri(DatabaseOf(folder)));
  if (!connection.ok()) return connection.status();
  return (*connection)
      ->Execute("SET session_replication_role = replica; UPDATE " + table +
                " SET " + column + " = overlay(" + column +
                " PLACING '\\x5a'::bytea FROM 21 FOR 1)");
}

}  // namespace selfcal::server
