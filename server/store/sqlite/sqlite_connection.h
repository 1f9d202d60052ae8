// Connections to an SQLite file.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <sqlite3.h>

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "server/store/driver/driver.h"

namespace selfcal::server {

class SqliteConnection final : public Connection {
 public:
  // `flags` as for sqlite3_open_v2.
  static absl::StatusOr<std::unique_ptr<SqliteConnection>> Open(
      const std::string& path, int flags);
  // A connection to an existing file that only reads.
  static absl::StatusOr<std::unique_ptr<SqliteConnection>> OpenReader(
      const std::string& path);
  ~SqliteConnection() override { DropPrepared(); }

  absl::Status Execute(const std::string& sql) override;
  bool in_transaction() const override {
    return sqlite3_get_autocommit(handle_.get()) == 0;
  }
  const Dialect& dialect() const override;
  absl::StatusOr<DatabaseSize> Size() override;
  absl::StatusOr<std::optional<DiskSpace>> Disk() override;
  absl::StatusOr<std::vector<Column>> Columns() override;
  void CheckStructure(
      const std::function<bool(const StoreProblem&)>& on_problem) override;

  // The canonical error of a result code, with SQLite's message; OK for
  // SQLITE_OK, SQLITE_ROW and SQLITE_DONE.
  absl::Status StatusOf(int code, std::string_view what) const;

  sqlite3* handle() const { return handle_.get(); }

 private:
  struct Close {
    void operator()(sqlite3* handle) const { sqlite3_close_v2(handle); }
  };

  explicit SqliteConnection(sqlite3* handle) : handle_(handle) {}
  absl::StatusOr<std::unique_ptr<PreparedStatement>> Prepare(
      std::string_view sql) override;

  std::unique_ptr<sqlite3, Close> handle_;
};

}  // namespace selfcal::server
