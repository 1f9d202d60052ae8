// A connection to a PostgreSQL server, by libpq.
//
// One statement may stream its rows at a time; another one that begins before
// the end makes the first keep the rest of its rows in memory. So a statement
// that reads a whole table needs memory for one row only, as long as nothing
// else runs on the connection.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <libpq-fe.h>

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "server/store/driver/driver.h"

namespace selfcal::server {

class PostgresStatement;

struct ClearResult {
  void operator()(PGresult* result) const { PQclear(result); }
};
using PostgresResult = std::unique_ptr<PGresult, ClearResult>;

class PostgresConnection final : public Connection {
 public:
  // Why a transaction failed, where that decides about running it again.
  enum class Failure {
    kNone,      // or for a reason of its own
    kConflict,  // with another transaction; it was rolled back
    kLost,      // the connection, before the commit: it is rolled back
    kUnknown,   // the connection, during the commit: it may be committed
  };

  // Connects, with synchronous commits. Errors as for ConnectionError;
  // INVALID_ARGUMENT if `uri` is not valid; FAILED_PRECONDITION if the encoding
  // of the database is not UTF-8.
  static absl::StatusOr<std::unique_ptr<PostgresConnection>> Open(
      const std::string& uri);
  ~PostgresConnection() override;

  absl::Status Execute(const std::string& sql) override;
  bool in_transaction() const override;
  const Dialect& dialect() const override;
  absl::Status Announce(const std::string& text) override;
  absl::StatusOr<DatabaseSize> Size() override;
  absl::StatusOr<std::vector<Column>> Columns() override;
  void CheckStructure(
      const std::function<bool(const StoreProblem&)>& on_problem) override;

  // The channel of announcements about the tables of this schema, quoted.
  absl::StatusOr<std::string> Channel();
  // Begins each announcement, so that its sender can be told.
  void SetOrigin(std::string origin) { origin_ = std::move(origin); }

  // The most serious failure since ClearFailure.
  Failure failure() const { return failure_; }
  void ClearFailure() { failure_ = Failure::kNone; }
  // True if only a new connection can help.
  bool lost() const;

  PGconn* handle() const { return handle_.get(); }
  const std::string& uri() const { return uri_; }

  // For PostgresStatement.

  // Waits for the rows of the statement that streams, if any, and notes that
  // `sql` begins.
  void BeginCommand(std::string_view sql);
  // `statement` streams from now on; null: none does.
  void SetStreaming(PostgresStatement* statement) { streaming_ = statement; }
  // The error of a result, or of the connection if it is null; also notes it in
  // failure(). In a transaction that has failed, the error that caused it.
  absl::Status ErrorOf(const PGresult* result, std::string_view sql);
  // For the result of COMMIT: an error if the server rolled back instead, or
  // warned that the commit is not as durable as it has to be.
  absl::Status CheckCommitted(const PGresult* result);
  std::string NewStatementName();
  // Frees a prepared statement of the server when the connection is next used.
  void Discard(std::string name);

 private:
  struct Finish {
    void operator()(PGconn* handle) const { PQfinish(handle); }
  };

  PostgresConnection(std::string uri, PGconn* handle)
      : uri_(std::move(uri)), handle_(handle) {}
  absl::StatusOr<std::unique_ptr<PreparedStatement>> Prepare(
      std::string_view sql) override;
  absl::Status SetUp();
  void FreeDiscarded();

  const std::string uri_;
  const std::unique_ptr<PGconn, Finish> handle_;
  PostgresStatement* streaming_ = nullptr;
  Failure failure_ = Failure::kNone;
  absl::Status error_;    // the last one
  bool commits_ = false;  // the command that runs ends a transaction
  bool warned_ = false;   // by the server, during that command
  bool standby_ = false;  // the server refuses to write
  std::string origin_;
  std::int64_t names_ = 0;
  std::vector<std::string> discarded_;
};

}  // namespace selfcal::server
