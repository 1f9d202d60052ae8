#include "server/store/postgres/postgres_connection.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "server/status/status_macros.h"
#include "server/store/driver/statement.h"
#include "server/store/postgres/postgres_error.h"
#include "server/store/postgres/postgres_schema_check.h"
#include "server/store/postgres/postgres_statement.h"
#include "server/store/postgres/store_uri.h"

namespace selfcal::server {
namespace {

// A transaction that writes locks the row of its rig first, so that of two on
// one rig the second waits, and then sees what the first has committed: each
// statement reads the newest state. In a stricter level it would fail instead.
constexpr Dialect kDialect{
    .begin_write = "BEGIN ISOLATION LEVEL READ COMMITTED READ WRITE",
    .begin_read = "BEGIN ISOLATION LEVEL REPEATABLE READ READ ONLY",
    .for_update = " FOR UPDATE",
    .blob_type = "bytea"};

// What the address does not state. A server that does not answer is noticed
// within half a minute, and of several hosts the primary is found.
constexpr const char* kDefaults[][2] = {{"connect_timeout", "5"},
                                        {"keepalives_idle", "20"},
                                        {"keepalives_interval", "5"},
                                        {"keepalives_count", "2"},
                                        {"tcp_user_timeout", "30000"},
                                        {"target_session_attrs", "read-write"},
                                        {"application_name", "selfcald"}};

// The caller sends the same again: a segment has an identity.
absl::Status UnknownOutcome(const std::string& why) {
  return absl::UnavailableError(
      fmt::format("the commit may or may not have succeeded: send the same "
                  "again, which is harmless ({})",
                  why));
}

// Of a commit, the only one is that its wait for a synchronous standby was cut
// short: it is on one disk only.
bool IsWarning(const PGresult* notice) {
  const char* const severity =
      PQresultErrorField(notice, PG_DIAG_SEVERITY_NONLOCALIZED);
  return severity != nullptr && std::string_view(severity) == "WARNING";
}

}  // namespace

absl::StatusOr<std::unique_ptr<PostgresConnection>> PostgresConnection::Open(
    const std::string& uri) {
  SELFCAL_RETURN_IF_ERROR(ShownUri(uri).status());
  std::vector<const char*> keywords;
  std::vector<const char*> values;
  const auto add = [&](const char* keyword, const char* value) {
    keywords.push_back(keyword);
    values.push_back(value);
  };
  for (const auto& [keyword, value] : kDefaults) add(keyword, value);
  add("dbname", uri.c_str());  // replaces what is before it
  add("client_encoding", "UTF8");
  add(nullptr, nullptr);
  std::unique_ptr<PostgresConnection> connection(new PostgresConnection(
      uri, PQconnectdbParams(keywords.data(), values.data(), 1)));
  if (PQstatus(connection->handle()) != CONNECTION_OK) {
    return ConnectionError(PQerrorMessage(connection->handle()));
  }
  SELFCAL_RETURN_IF_ERROR(connection->SetUp());
  return connection;
}

absl::Status PostgresConnection::SetUp() {
  PQsetNoticeReceiver(
      handle(),
      [](void* connection, const PGresult* notice) {
        if (IsWarning(notice)) {
          static_cast<PostgresConnection*>(connection)->warned_ = true;
        }
      },
      this);
  const char* const encoding = PQparameterStatus(handle(), "server_encoding");
  if (encoding == nullptr || std::string_view(encoding) != "UTF8") {
    return absl::FailedPreconditionError(
        "the encoding of the database is not UTF8: create it with ENCODING "
        "'UTF8'");
  }
  // A transaction that is acknowledged must be on disk, whatever the settings
  // of the server, of the database and of the user are. One whose client does
  // not go on must not hold the lock on its rig for ever. Compilation takes
  // longer than any of the statements.
  return Execute(
      "SELECT set_config('synchronous_commit', 'on', false) "
      "WHERE current_setting('synchronous_commit') IN ('off', 'local');"
      "SET idle_in_transaction_session_timeout = '60s';"
      "SET jit = off");
}

PostgresConnection::~PostgresConnection() { DropPrepared(); }

void PostgresConnection::BeginCommand(std::string_view sql) {
  if (streaming_ != nullptr) streaming_->BufferRest();
  FreeDiscarded();
  warned_ = false;
  // Outside a transaction, each statement commits by itself. On a connection
  // that is known to be lost, nothing is sent.
  commits_ = PQstatus(handle()) == CONNECTION_OK &&
             (sql == "COMMIT" ||
              (!sql.empty() && !in_transaction() && !sql.starts_with("BEGIN")));
}

absl::Status PostgresConnection::Execute(const std::string& sql) {
  BeginCommand(sql);
  const PostgresResult result(PQexec(handle(), sql.c_str()));
  const ExecStatusType status = PQresultStatus(result.get());
  if (status == PGRES_COMMAND_OK || status == PGRES_TUPLES_OK) {
    return absl::OkStatus();
  }
  return ErrorOf(result.get(), sql);
}

bool PostgresConnection::in_transaction() const {
  const PGTransactionStatusType status = PQtransactionStatus(handle());
  return status == PQTRANS_ACTIVE || status == PQTRANS_INTRANS ||
         status == PQTRANS_INERROR;
}

bool PostgresConnection::lost() const {
  return standby_ || PQstatus(handle()) != CONNECTION_OK;
}

absl::Status PostgresConnection::ErrorOf(const PGresult* result,
                                         std::string_view sql) {
  const char* const field = result == nullptr
                                ? nullptr
                                : PQresultErrorField(result, PG_DIAG_SQLSTATE);
  const std::string_view sqlstate = field == nullptr ? "" : field;
  // The transaction has failed before: that error is the cause.
  if (sqlstate == "25P02" && !error_.ok()) return error_;
  if (sqlstate.empty() || EndsConnection(sqlstate) || lost()) {
    standby_ = standby_ || sqlstate == "25006";
    failure_ = std::max(
        failure_,
        commits_ && sqlstate != "25006" ? Failure::kUnknown : Failure::kLost);
  } else if (IsConflict(sqlstate)) {
    failure_ = std::max(failure_, Failure::kConflict);
  }
  error_ =
      sqlstate.empty()
          ? ConnectionError(PQerrorMessage(handle()))
          : PostgresError(sqlstate,
                          PQresultErrorField(result, PG_DIAG_MESSAGE_PRIMARY),
                          sql);
  if (failure_ == Failure::kUnknown) {
    error_ = UnknownOutcome(std::string(error_.message()));
  }
  return error_;
}

absl::Status PostgresConnection::CheckCommitted(const PGresult* result) {
  if (std::string_view(PQcmdStatus(const_cast<PGresult*>(result))) !=
      "COMMIT") {
    if (!error_.ok()) return error_;
    return absl::InternalError(
        "the database rolled the transaction back instead of committing it");
  }
  if (!warned_) return absl::OkStatus();
  failure_ = Failure::kUnknown;
  return UnknownOutcome("the wait for a standby was cut short");
}

const Dialect& PostgresConnection::dialect() const { return kDialect; }

absl::Status PostgresConnection::Announce(const std::string& text) {
  return Statement(this,
                   "SELECT CAST(pg_notify('selfcal_' || current_schema(), ?1) "
                   "AS TEXT)",
                   origin_ + " " + text)
      .Run();
}

absl::StatusOr<std::string> PostgresConnection::Channel() {
  Statement read(this, "SELECT quote_ident('selfcal_' || current_schema())");
  std::string channel;
  if (read.Next()) channel = read.Text(0);
  SELFCAL_RETURN_IF_ERROR(read.status());
  return channel;
}

absl::StatusOr<DatabaseSize> PostgresConnection::Size() {
  SELFCAL_ASSIGN_OR_RETURN(
      const std::int64_t bytes,
      ReadInt(this, "SELECT pg_database_size(current_database())"));
  return DatabaseSize{bytes, bytes};
}

absl::StatusOr<std::vector<Column>> PostgresConnection::Columns() {
  Statement read(this,
                 "SELECT CAST(c.relname AS TEXT), CAST(a.attname AS TEXT), "
                 "  format_type(a.atttypid, a.atttypmod) FROM pg_class c "
                 "JOIN pg_attribute a ON a.attrelid = c.oid "
                 "WHERE c.relnamespace = current_schema()::regnamespace "
                 "  AND c.relkind IN ('r', 'p') AND a.attnum > 0 "
                 "  AND NOT a.attisdropped "
                 "  AND c.relname <> 'schema_migrations' "
                 "ORDER BY c.relname COLLATE \"C\", a.attnum");
  std::vector<Column> columns;
  while (read.Next()) {
    columns.push_back({read.Text(0), read.Text(1), read.Text(2)});
  }
  SELFCAL_RETURN_IF_ERROR(read.status());
  return columns;
}

void PostgresConnection::CheckStructure(
    const std::function<bool(const StoreProblem&)>& on_problem) {
  CheckPostgresStructure(this, on_problem);
}

std::string PostgresConnection::NewStatementName() {
  return "s" + std::to_string(++names_);
}

void PostgresConnection::Discard(std::string name) {
  discarded_.push_back(std::move(name));
}

void PostgresConnection::FreeDiscarded() {
  // A transaction that has failed accepts no command.
  if (PQtransactionStatus(handle()) == PQTRANS_INERROR) return;
  for (const std::string& name : discarded_) {
    const PostgresResult freed(
        PQexec(handle(), ("DEALLOCATE " + name).c_str()));
  }
  discarded_.clear();
}

absl::StatusOr<std::unique_ptr<PreparedStatement>> PostgresConnection::Prepare(
    std::string_view sql) {
  return PostgresStatement::Prepare(this, sql);
}

}  // namespace selfcal::server
