// A prepared statement of SQLite.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <sqlite3.h>

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "server/store/sqlite/sqlite_connection.h"

namespace selfcal::server {

class SqliteStatement final : public PreparedStatement {
 public:
  // The connection must outlive the statement.
  static absl::StatusOr<std::unique_ptr<PreparedStatement>> Prepare(
      const SqliteConnection* connection, std::string_view sql);

  absl::Status BindInt(int index, std::int64_t value) override;
  absl::Status BindDouble(int index, double value) override;
  absl::Status BindText(int index, std::string_view value) override;
  absl::Status BindBlob(int index, std::string_view bytes) override;
  absl::StatusOr<bool> Step() override;
  std::int64_t Int(int column) const override;
  double Double(int column) const override;
  std::string Text(int column) const override;
  bool IsNull(int column) const override;
  void Reset() override;

 private:
  struct Finalize {
    void operator()(sqlite3_stmt* handle) const { sqlite3_finalize(handle); }
  };

  SqliteStatement(const SqliteConnection* connection,
                  std::string_view sql,
                  sqlite3_stmt* handle)
      : PreparedStatement(sql), connection_(connection), handle_(handle) {}
  absl::Status StatusOf(int code) const {
    return connection_->StatusOf(code, sql());
  }

  const SqliteConnection* const connection_;
  const std::unique_ptr<sqlite3_stmt, Finalize> handle_;
};

}  // namespace selfcal::server
