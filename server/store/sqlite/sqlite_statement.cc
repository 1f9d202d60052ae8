#include "server/store/sqlite/sqlite_statement.h"

namespace selfcal::server {

absl::StatusOr<std::unique_ptr<PreparedStatement>> SqliteStatement::Prepare(
    const SqliteConnection* connection, std::string_view sql) {
  sqlite3_stmt* handle = nullptr;
  const int code = sqlite3_prepare_v3(connection->handle(),
                                      sql.data(),
                                      static_cast<int>(sql.size()),
                                      SQLITE_PREPARE_PERSISTENT,
                                      &handle,
                                      nullptr);
  if (code != SQLITE_OK) return connection->StatusOf(code, sql);
  return std::unique_ptr<PreparedStatement>(
      new SqliteStatement(connection, sql, handle));
}

absl::Status SqliteStatement::BindInt(int index, std::int64_t value) {
  return StatusOf(sqlite3_bind_int64(handle_.get(), index, value));
}

absl::Status SqliteStatement::BindDouble(int index, double value) {
  return StatusOf(sqlite3_bind_double(handle_.get(), index, value));
}

absl::Status SqliteStatement::BindText(int index, std::string_view value) {
  return StatusOf(sqlite3_bind_text64(handle_.get(),
                                      index,
                                      value.data() ? value.data() : "",
                                      value.size(),
                                      SQLITE_TRANSIENT,
                                      SQLITE_UTF8));
}

absl::Status SqliteStatement::BindBlob(int index, std::string_view bytes) {
  return StatusOf(sqlite3_bind_blob64(
      handle_.get(), index, bytes.data(), bytes.size(), SQLITE_STATIC));
}

absl::StatusOr<bool> SqliteStatement::Step() {
  const int code = sqlite3_step(handle_.get());
  if (code == SQLITE_ROW) return true;
  if (code == SQLITE_DONE) return false;
  return StatusOf(code);
}

std::int64_t SqliteStatement::Int(int column) const {
  return sqlite3_column_int64(handle_.get(), column);
}

double SqliteStatement::Double(int column) const {
  return sqlite3_column_double(handle_.get(), column);
}

std::string SqliteStatement::Text(int column) const {
  const void* bytes = sqlite3_column_blob(handle_.get(), column);
  const int size = sqlite3_column_bytes(handle_.get(), column);
  return bytes == nullptr ? std::string()
                          : std::string(static_cast<const char*>(bytes), size);
}

bool SqliteStatement::IsNull(int column) const {
  return sqlite3_column_type(handle_.get(), column) == SQLITE_NULL;
}

void SqliteStatement::Reset() {
  sqlite3_reset(handle_.get());  // repeats the error of the last step
  sqlite3_clear_bindings(handle_.get());
}

}  // namespace selfcal::server
