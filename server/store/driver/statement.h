// One use of an SQL statement: it is prepared and its arguments are bound when
// it is constructed.
//
// A statement keeps its first error: step and read, then check the status once.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "server/store/driver/driver.h"

namespace selfcal::server {

// Bytes to bind as such. Does not own them.
struct BlobView {
  std::string_view bytes;
};

// The life of a prepared statement: a connection keeps kKept for the next use
// of the same text. kOnce is for texts of which there are many: they would take
// the places of others. An engine then also plans for the values that are
// bound.
enum class Reuse { kKept, kOnce };

// The connection and the bytes that are bound must outlive the statement.
class Statement {
 public:
  // Prepares `sql` and binds the arguments to ?1, ?2, ...
  template <typename... Args>
  Statement(Connection* connection, std::string_view sql, const Args&... args)
      : Statement(connection, Reuse::kKept, sql, args...) {}
  template <typename... Args>
  Statement(Connection* connection,
            Reuse reuse,
            std::string_view sql,
            const Args&... args)
      : connection_(connection) {
    Prepare(sql, reuse);
    (BindNext(args), ...);
  }
  ~Statement() { connection_->Keep(std::move(prepared_)); }
  Statement(const Statement&) = delete;
  Statement& operator=(const Statement&) = delete;

  // Binds the parameter after those that are bound.
  template <typename T>
  void BindNext(const T& value) {
    Bind(++bound_, value);
  }

  // Steps to the next row. False at the end, or after an error.
  bool Next();
  // Steps to the end.
  absl::Status Run();
  const absl::Status& status() const { return status_; }

  // Columns of the current row, from 0. NULL reads as 0 or empty.
  std::int64_t Int(int column) const { return prepared_->Int(column); }
  double Double(int column) const { return prepared_->Double(column); }
  // Of text or bytes.
  std::string Text(int column) const { return prepared_->Text(column); }
  bool IsNull(int column) const { return prepared_->IsNull(column); }

 private:
  void Prepare(std::string_view sql, Reuse reuse);
  void Bind(int index, std::int64_t value);
  void Bind(int index, int value) { Bind(index, std::int64_t{value}); }
  void Bind(int index, double value);
  template <typename T>
  void Bind(int index, const std::optional<T>& value) {
    if (value) Bind(index, *value);  // unbound is NULL
  }
  void Bind(int index, std::string_view value);
  void Bind(int index, const std::string& value) {
    Bind(index, std::string_view(value));
  }
  void Bind(int index, BlobView value);

  Connection* connection_;
  std::unique_ptr<PreparedStatement> prepared_;  // null after an error
  int bound_ = 0;                                // parameters
  absl::Status status_;
};

// The number in the first row of `sql`; 0 if there is none.
template <typename... Args>
absl::StatusOr<std::int64_t> ReadInt(Connection* db,
                                     std::string_view sql,
                                     const Args&... args) {
  Statement read(db, sql, args...);
  const bool found = read.Next();
  if (!read.status().ok()) return read.status();
  return found ? read.Int(0) : 0;
}

// The number that an INSERT ... RETURNING returns.
template <typename... Args>
absl::StatusOr<std::int64_t> InsertReturning(Connection* db,
                                             std::string_view sql,
                                             const Args&... args) {
  Statement insert(db, sql, args...);
  const std::int64_t number = insert.Next() ? insert.Int(0) : 0;
  const absl::Status status = insert.Run();
  if (!status.ok()) return status;
  return number;
}

}  // namespace selfcal::server
