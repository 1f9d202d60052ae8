#include "server/store/statement.h"

#include <fmt/format.h>

namespace selfcal::server {
namespace {

// Prepared statements that a connection keeps, a few kB each.
constexpr std::size_t kMaxPrepared = 128;

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
  Connection connection(handle);  // to be closed even if opening failed
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

Connection::Prepared Connection::Take(std::string_view sql, int* code) {
  const auto found = prepared_.find(sql);
  if (found != prepared_.end() && found->second != nullptr) {
    *code = SQLITE_OK;
    return std::move(found->second);
  }
  sqlite3_stmt* prepared = nullptr;
  *code = sqlite3_prepare_v3(handle(),
                             sql.data(),
                             static_cast<int>(sql.size()),
                             SQLITE_PREPARE_PERSISTENT,
                             &prepared,
                             nullptr);
  Prepared owned(prepared);
  // Allocates its place here, since Keep runs in a destructor.
  if (found == prepared_.end() && prepared_.size() < kMaxPrepared) {
    prepared_.emplace(sql, nullptr);
  }
  return owned;
}

void Connection::Keep(Prepared prepared) {
  if (prepared == nullptr) return;
  const auto place = prepared_.find(sqlite3_sql(prepared.get()));
  if (place == prepared_.end() || place->second != nullptr) return;
  sqlite3_reset(prepared.get());  // repeats the error of the last step
  sqlite3_clear_bindings(prepared.get());
  place->second = std::move(prepared);
}

void Statement::Prepare(std::string_view sql) {
  int code = SQLITE_OK;
  statement_ = connection_->Take(sql, &code);
  Check(code);
}

bool Statement::Next() {
  if (!status_.ok()) {
    return false;
  }
  const int code = sqlite3_step(statement_.get());
  Check(code);
  return code == SQLITE_ROW;
}

absl::Status Statement::Run() {
  while (Next()) {
  }
  return status_;
}

std::int64_t Statement::Int(int column) const {
  return sqlite3_column_int64(statement_.get(), column);
}

double Statement::Double(int column) const {
  return sqlite3_column_double(statement_.get(), column);
}

std::string Statement::Text(int column) const {
  const void* bytes = sqlite3_column_blob(statement_.get(), column);
  const int size = sqlite3_column_bytes(statement_.get(), column);
  return bytes == nullptr ? std::string()
                          : std::string(static_cast<const char*>(bytes), size);
}

bool Statement::IsNull(int column) const {
  return sqlite3_column_type(statement_.get(), column) == SQLITE_NULL;
}

void Statement::Bind(int index, std::int64_t value) {
  if (status_.ok()) Check(sqlite3_bind_int64(statement_.get(), index, value));
}

void Statement::Bind(int index, int value) { Bind(index, std::int64_t{value}); }

void Statement::Bind(int index, double value) {
  if (status_.ok()) Check(sqlite3_bind_double(statement_.get(), index, value));
}

void Statement::Bind(int index, std::string_view value) {
  if (status_.ok()) {
    Check(sqlite3_bind_text64(statement_.get(),
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
    // The caller's bytes outlive the statement.
    Check(sqlite3_bind_blob64(statement_.get(),
                              index,
                              value.bytes.data(),
                              value.bytes.size(),
                              SQLITE_STATIC));
  }
}

void Statement::Check(int code) {
  if (status_.ok()) {
    const char* sql = statement_ ? sqlite3_sql(statement_.get()) : nullptr;
    status_ = connection_->StatusOf(code, sql ? sql : "prepare");
  }
}

Transaction::Transaction(Connection* connection)
    : connection_(connection), nested_(connection->in_transaction()) {
  status_ =
      Statement(connection_, nested_ ? "SAVEPOINT part" : "BEGIN IMMEDIATE")
          .Run();
  open_ = status_.ok();
}

Transaction::~Transaction() {
  // After some errors SQLite has rolled back by itself.
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
      Statement(connection_, nested_ ? "RELEASE part" : "COMMIT").Run();
  if (status.ok()) {
    open_ = false;
  }
  return status;
}

Snapshot::Snapshot(Connection* connection)
    : connection_(connection), status_(Statement(connection, "BEGIN").Run()) {}

Snapshot::~Snapshot() {
  if (status_.ok() && connection_->in_transaction()) {
    sqlite3_exec(connection_->handle(), "COMMIT", nullptr, nullptr, nullptr);
  }
}

std::int64_t LastInsertedRow(Connection* db) {
  return sqlite3_last_insert_rowid(db->handle());
}

}  // namespace selfcal::server
