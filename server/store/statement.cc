#include "server/store/statement.h"

#include <fmt/format.h>

namespace selfcal::server {
namespace {

absl::StatusCode CanonicalCode(int primary) {
  switch (primary) {
    case SQLITE_FULL:
    case SQLITE_NOMEM:
      return absl::StatusCode::kResourceExhausted;
    case SQLITE_IOERR:
    case SQLITE_BUSY:
    case SQLITE_LOCKED:
    case SQLITE_CANTOPEN:
    case SQLITE_READONLY:
    case SQLITE_PERM:
      return absl::StatusCode::kUnavailable;
    case SQLITE_CORRUPT:
    case SQLITE_NOTADB:
      return absl::StatusCode::kDataLoss;
    default:
      return absl::StatusCode::kInternal;
  }
}

std::string_view Advice(int primary) {
  switch (primary) {
    case SQLITE_FULL:
      return "the disk is full: free some space and try again; nothing was "
             "changed";
    case SQLITE_NOMEM:
      return "memory is short: try again later; nothing was changed";
    case SQLITE_IOERR:
      return "the disk failed: check it and the system's log, then restart the "
             "daemon; nothing was changed";
    case SQLITE_BUSY:
    case SQLITE_LOCKED:
      return "another process holds the database: end it and try again";
    case SQLITE_CANTOPEN:
    case SQLITE_READONLY:
    case SQLITE_PERM:
      return "the database cannot be opened for writing: check that its folder "
             "exists and belongs to the daemon's user";
    case SQLITE_CORRUPT:
    case SQLITE_NOTADB:
      return "the database is damaged: stop the daemon, keep a copy of the "
             "file, and put a backup in its place";
    default:
      return "this is a defect of the program: please report it";
  }
}

}  // namespace

absl::StatusOr<Connection> Connection::Open(const std::string& path,
                                            int flags) {
  sqlite3* handle = nullptr;
  const int code = sqlite3_open_v2(path.c_str(), &handle, flags, nullptr);
  Connection connection(handle);  // also a failed open gives one to close
  if (code != SQLITE_OK) {
    return connection.StatusOf(code, "open " + path);
  }
  sqlite3_extended_result_codes(handle, 1);
  return connection;
}

absl::Status Connection::Execute(const std::string& sql) {
  return StatusOf(
      sqlite3_exec(handle(), sql.c_str(), nullptr, nullptr, nullptr), sql);
}

absl::Status Connection::StatusOf(int code, std::string_view what) const {
  if (code == SQLITE_OK || code == SQLITE_ROW || code == SQLITE_DONE) {
    return absl::OkStatus();
  }
  const int primary = code & 0xff;
  const char* words =
      handle_ ? sqlite3_errmsg(handle_.get()) : sqlite3_errstr(code);
  return absl::Status(CanonicalCode(primary),
                      fmt::format("{} (SQLite {}: {}; at: {})",
                                  Advice(primary),
                                  code,
                                  words,
                                  what.substr(0, 120)));
}

void Statement::Prepare(std::string_view sql) {
  Check(sqlite3_prepare_v2(connection_->handle(),
                           sql.data(),
                           static_cast<int>(sql.size()),
                           &statement_,
                           nullptr));
}

bool Statement::Next() {
  if (!status_.ok()) {
    return false;
  }
  const int code = sqlite3_step(statement_);
  Check(code);
  return code == SQLITE_ROW;
}

absl::Status Statement::Run() {
  while (Next()) {
  }
  return status_;
}

std::int64_t Statement::Int(int column) const {
  return sqlite3_column_int64(statement_, column);
}

double Statement::Double(int column) const {
  return sqlite3_column_double(statement_, column);
}

std::string Statement::Text(int column) const {
  const void* bytes = sqlite3_column_blob(statement_, column);
  const int size = sqlite3_column_bytes(statement_, column);
  return bytes == nullptr ? std::string()
                          : std::string(static_cast<const char*>(bytes), size);
}

bool Statement::IsNull(int column) const {
  return sqlite3_column_type(statement_, column) == SQLITE_NULL;
}

void Statement::Bind(int index, std::int64_t value) {
  if (status_.ok()) Check(sqlite3_bind_int64(statement_, index, value));
}

void Statement::Bind(int index, int value) { Bind(index, std::int64_t{value}); }

void Statement::Bind(int index, double value) {
  if (status_.ok()) Check(sqlite3_bind_double(statement_, index, value));
}

void Statement::Bind(int index, std::string_view value) {
  if (status_.ok()) {
    Check(sqlite3_bind_text64(statement_,
                              index,
                              value.data() ? value.data() : "",
                              value.size(),
                              SQLITE_TRANSIENT,
                              SQLITE_UTF8));
  }
}

void Statement::Bind(int index, const std::string& value) {
  Bind(index, std::string_view(value));
}

void Statement::Bind(int index, BlobView value) {
  if (status_.ok()) {
    // The statement is stepped and gone before the caller's bytes are.
    Check(sqlite3_bind_blob64(statement_,
                              index,
                              value.bytes.data(),
                              value.bytes.size(),
                              SQLITE_STATIC));
  }
}

void Statement::Check(int code) {
  if (status_.ok()) {
    const char* sql = statement_ ? sqlite3_sql(statement_) : nullptr;
    status_ = connection_->StatusOf(code, sql ? sql : "prepare");
  }
}

Transaction::Transaction(Connection* connection)
    : connection_(connection), nested_(connection->in_transaction()) {
  status_ =
      connection_->Execute(nested_ ? "SAVEPOINT part" : "BEGIN IMMEDIATE");
  open_ = status_.ok();
}

Transaction::~Transaction() {
  // SQLite has rolled back by itself after some errors; then there is nothing
  // left to do.
  if (open_ && connection_->in_transaction()) {
    sqlite3_exec(connection_->handle(),
                 nested_ ? "ROLLBACK TO part; RELEASE part" : "ROLLBACK",
                 nullptr,
                 nullptr,
                 nullptr);
  }
}

absl::Status Transaction::Commit() {
  absl::Status status =
      connection_->Execute(nested_ ? "RELEASE part" : "COMMIT");
  if (status.ok()) {
    open_ = false;
  }
  return status;
}

Snapshot::Snapshot(Connection* connection)
    : connection_(connection), status_(connection->Execute("BEGIN")) {}

Snapshot::~Snapshot() {
  if (status_.ok() && connection_->in_transaction()) {
    sqlite3_exec(connection_->handle(), "COMMIT", nullptr, nullptr, nullptr);
  }
}

}  // namespace selfcal::server
