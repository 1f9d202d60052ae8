// Thin owners of SQLite handles: connections, statements, transactions.
//
// A connection and everything made from it may be used by one thread at a time.
// SQLite errors become canonical ones that say what to do
// (Connection::StatusOf). A statement keeps its first error: bind, step and
// read, then check the status once.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <sqlite3.h>

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

namespace selfcal::server {

// Bytes to bind as a BLOB. Does not own them.
struct BlobView {
  std::string_view bytes;
};

class Connection {
 public:
  // `flags` as for sqlite3_open_v2.
  static absl::StatusOr<Connection> Open(const std::string& path, int flags);

  // Runs one or several statements that return no rows.
  absl::Status Execute(const std::string& sql);

  // The canonical error of a result code, with SQLite's message; OK for
  // SQLITE_OK, SQLITE_ROW and SQLITE_DONE.
  absl::Status StatusOf(int code, std::string_view what) const;

  // True if a transaction is open; after some errors SQLite ends one by itself.
  bool in_transaction() const {
    return sqlite3_get_autocommit(handle_.get()) == 0;
  }

  sqlite3* handle() const { return handle_.get(); }

 private:
  friend class Statement;
  struct Close {
    void operator()(sqlite3* handle) const { sqlite3_close_v2(handle); }
  };
  struct Finalize {
    void operator()(sqlite3_stmt* prepared) const {
      sqlite3_finalize(prepared);
    }
  };
  using Prepared = std::unique_ptr<sqlite3_stmt, Finalize>;

  explicit Connection(sqlite3* handle) : handle_(handle) {}
  Prepared Take(std::string_view sql, int* code);  // null after an error
  void Keep(Prepared prepared);

  std::unique_ptr<sqlite3, Close> handle_;
  // Prepared statements by their SQL: preparing one takes longer than running
  // it. Null while in use.
  std::map<std::string, Prepared, std::less<>> prepared_;
};

// The connection must outlive the statement and must not move meanwhile.
class Statement {
 public:
  // Prepares `sql` and binds the arguments to ?1, ?2, ...
  template <typename... Args>
  Statement(Connection* connection, std::string_view sql, const Args&... args)
      : connection_(connection) {
    Prepare(sql);
    int index = 0;
    (Bind(++index, args), ...);
  }
  ~Statement() { connection_->Keep(std::move(statement_)); }
  Statement(const Statement&) = delete;
  Statement& operator=(const Statement&) = delete;

  // Steps to the next row. False at the end, or after an error.
  bool Next();
  // Steps to the end.
  absl::Status Run();
  const absl::Status& status() const { return status_; }

  // Columns of the current row, from 0.
  std::int64_t Int(int column) const;
  double Double(int column) const;
  std::string Text(int column) const;  // of a TEXT or a BLOB
  bool IsNull(int column) const;

 private:
  void Prepare(std::string_view sql);
  void Bind(int index, std::int64_t value);
  void Bind(int index, int value);
  void Bind(int index, double value);
  template <typename T>
  void Bind(int index, const std::optional<T>& value) {
    if (value) Bind(index, *value);  // unbound is NULL
  }
  void Bind(int index, std::string_view value);
  void Bind(int index, const std::string& value);
  void Bind(int index, BlobView value);
  void Check(int code);

  Connection* connection_;
  Connection::Prepared statement_;
  absl::Status status_;
};

// BEGIN IMMEDIATE; rolls back unless committed. Inside another transaction it
// is a savepoint: its rollback keeps the changes of the outer transaction, and
// its commit becomes durable with the outer one.
class Transaction {
 public:
  explicit Transaction(Connection* connection);
  ~Transaction();
  Transaction(const Transaction&) = delete;
  Transaction& operator=(const Transaction&) = delete;

  // An error if it could not begin.
  const absl::Status& status() const { return status_; }
  absl::Status Commit();

 private:
  Connection* connection_;
  absl::Status status_;
  bool nested_ = false;
  bool open_ = false;
};

// One state of the database for several statements that only read.
class Snapshot {
 public:
  explicit Snapshot(Connection* connection);
  ~Snapshot();
  Snapshot(const Snapshot&) = delete;
  Snapshot& operator=(const Snapshot&) = delete;

  const absl::Status& status() const { return status_; }

 private:
  Connection* connection_;
  absl::Status status_;
};

// The row id of the last INSERT.
std::int64_t LastInsertedRow(Connection* db);

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

}  // namespace selfcal::server
