// Reaches around the store, into its SQLite file.
#pragma once

#include <absl/status/status.h>

#include <cstdint>
#include <string>

#include "server/store/driver/statement.h"
#include "server/store/sqlite/sqlite_connection.h"

namespace selfcal::server {

// Creates the file if it is not there.
inline absl::Status ExecuteInFile(const std::string& path,
                                  const std::string& sql) {
  const auto db =
      SqliteConnection::Open(path, SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE);
  if (!db.ok()) return db.status();
  const absl::Status waits = (*db)->Execute("PRAGMA busy_timeout = 5000");
  return waits.ok() ? (*db)->Execute(sql) : waits;
}

// The first column of the first row, as a number or as text.
inline absl::StatusOr<std::int64_t> ReadIntInFile(const std::string& path,
                                                  const std::string& sql) {
  const auto db = SqliteConnection::Open(path, SQLITE_OPEN_READWRITE);
  if (!db.ok()) return db.status();
  return ReadInt(db->get(), sql);
}
inline absl::StatusOr<std::string> ReadTextInFile(const std::string& path,
                                                  const std::string& sql) {
  const auto db = SqliteConnection::Open(path, SQLITE_OPEN_READWRITE);
  if (!db.ok()) return db.status();
  Statement read(db->get(), sql);
  if (read.Next()) return read.Text(0);
  return read.status().ok() ? absl::NotFoundError(sql) : read.status();
}

// Changes one byte in each blob of a column, around the trigger that forbids
// it.
inline absl::Status DamageColumn(const std::string& path,
                                 const std::string& table,
                                 const std::string& column) {
  const auto trigger = ReadTextInFile(
      path,
      "SELECT sql FROM sqlite_schema WHERE name = 'calibrations_never_change'");
  if (!trigger.ok()) return trigger.status();
  return ExecuteInFile(path,
                       "DROP TRIGGER calibrations_never_change;"
                       "UPDATE " +
                           table + " SET " + column + " = CAST(substr(" +
                           column + ", 1, 20) || x'5a' || substr(" + column +
                           ", 22) AS BLOB);" + *trigger);
}

// The same, for the data of the segments with this index in their session.
inline absl::Status DamageSegmentData(const std::string& path,
                                      std::int64_t index) {
  return ExecuteInFile(path,
                       "UPDATE payloads SET data = x'00' "
                       "WHERE (rig, sequence) IN (SELECT rig, sequence "
                       "FROM segments WHERE session_index = " +
                           std::to_string(index) + ")");
}

// "ok", or what integrity_check and foreign_key_check find.
inline std::string IntegrityOf(const std::string& path) {
  const auto db = SqliteConnection::Open(path, SQLITE_OPEN_READWRITE);
  if (!db.ok()) return db.status().ToString();
  Statement check(db->get(), "PRAGMA integrity_check");
  if (!check.Next()) return check.status().ToString();
  if (check.Text(0) != "ok") return check.Text(0);
  Statement keys(db->get(), "PRAGMA foreign_key_check");
  return keys.Next() ? "a foreign key leads nowhere" : "ok";
}

}  // namespace selfcal::server
