// What the store needs of a database engine. server/store contains the records
// and their SQL; a driver contains everything that engines do differently.
// server/store/sqlite is the driver for SQLite, server/store/postgres that for
// PostgreSQL.
//
// Another driver is a folder beside it, with a library of its own, and provides
//
// - PreparedStatement, Connection and Database, and a function that opens a
//   Database, creating or migrating its tables first;
// - its migrations, in a folder beside migrations/sqlite. They create the same
//   tables, columns, constraints and triggers with the types of the engine;
//   migrations/CMakeLists.txt embeds them, migrations.h gives access to them;
// - the choice of the engine: a setting (server/daemon/settings.cc) by which
//   OpenStore (open_store.cc) opens it, and the libraries in
//   server/CMakeLists.txt and server/daemon/CMakeLists.txt;
// - an entry in Engines() of test/server/store/store_test.h, so that it passes
//   the tests of the store and of server/domain and the kills of runs, and
//   tests of its own.
//
// The SQL of the store is what SQLite and PostgreSQL have in common, and
//
// - numbers its parameters ?1, ?2, ... without a gap, and may use one several
//   times; one whose type does not follow from where it first stands has a
//   cast;
// - has parameters and results of four types: 64-bit integers, doubles, text in
//   UTF-8, and bytes (Dialect::blob_type). The driver converts truth values: as
//   parameters and results they are the integers 0 and 1;
// - uses ON CONFLICT and RETURNING;
// - joins a few rows with segments by CROSS JOIN: SQLite reads the tables in
//   that order. Without statistics it could read all segments of the rig first.
//
// Errors have canonical codes and say what to do: RESOURCE_EXHAUSTED (disk or
// memory is full), UNAVAILABLE (the disk or the engine fails), DATA_LOSS (the
// database is damaged), INTERNAL (a defect).
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "server/store/driver/database_copies.h"
#include "server/store/driver/store_problem.h"

namespace selfcal::server {

// A statement that can be run again with other parameters. Used by Statement
// (statement.h) alone.
class PreparedStatement {
 public:
  explicit PreparedStatement(std::string_view sql) : sql_(sql) {}
  virtual ~PreparedStatement() = default;
  PreparedStatement(const PreparedStatement&) = delete;
  PreparedStatement& operator=(const PreparedStatement&) = delete;

  const std::string& sql() const { return sql_; }

  // Parameters count from 1; one that was not bound is NULL, and so is NaN.
  // Bytes are not copied: they must stay until Reset. Text is copied.
  virtual absl::Status BindInt(int index, std::int64_t value) = 0;
  virtual absl::Status BindDouble(int index, double value) = 0;
  virtual absl::Status BindText(int index, std::string_view value) = 0;
  virtual absl::Status BindBlob(int index, std::string_view bytes) = 0;

  // Steps to the next row; false at the end.
  virtual absl::StatusOr<bool> Step() = 0;

  // Columns of the current row, from 0. NULL reads as 0 or empty.
  virtual std::int64_t Int(int column) const = 0;
  virtual double Double(int column) const = 0;
  virtual std::string Text(int column) const = 0;  // of text or bytes
  virtual bool IsNull(int column) const = 0;

  // As newly prepared, without parameters.
  virtual void Reset() = 0;

 private:
  const std::string sql_;
};

// The SQL that engines write differently.
struct Dialect {
  std::string_view begin_write;  // begins a transaction that writes
  std::string_view begin_read;   // begins one that reads a single state
  // Ends a SELECT of a row that the transaction keeps others from changing;
  // empty where transactions that write exclude each other anyway.
  std::string_view for_update;
  std::string_view blob_type;  // as Column::type has it
};

struct Column {
  std::string table;
  std::string name;
  std::string type;
};

struct DatabaseSize {
  std::int64_t bytes = 0;
  std::int64_t used_bytes = 0;  // without room that later records can fill
};

// A file system that other programs use as well.
struct DiskSpace {
  std::int64_t bytes = 0;
  std::int64_t free_bytes = 0;  // for this process
};

// A connection and everything made from it may be used by one thread at a time.
class Connection {
 public:
  virtual ~Connection() = default;
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  // Runs one or several statements without parameters and results.
  virtual absl::Status Execute(const std::string& sql) = 0;
  // True if a transaction is open; after some errors an engine ends one by
  // itself.
  virtual bool in_transaction() const = 0;
  virtual const Dialect& dialect() const = 0;

  // Passes the text on to those who listen in other processes
  // (Database::Listen), when the transaction that is open has committed. An
  // engine of one process has none.
  virtual absl::Status Announce(const std::string& /*text*/) {
    return absl::OkStatus();
  }

  virtual absl::StatusOr<DatabaseSize> Size() = 0;
  // That of the file; nullopt for an engine that is a server.
  virtual absl::StatusOr<std::optional<DiskSpace>> Disk() {
    return std::nullopt;
  }
  // Columns of all tables of the store.
  virtual absl::StatusOr<std::vector<Column>> Columns() = 0;
  // Checks all that the engine knows to check: that the schema is that of its
  // migrations, pages, indices, references. Ends early once `on_problem`
  // returns false.
  virtual void CheckStructure(
      const std::function<bool(const StoreProblem&)>& on_problem) = 0;

  // For Statement: a statement that is kept from before, as preparing one takes
  // longer than running it, or a new one. It is given back by Keep.
  absl::StatusOr<std::unique_ptr<PreparedStatement>> Take(std::string_view sql);
  void Keep(std::unique_ptr<PreparedStatement> prepared);
  // A new one for a text that is not worth keeping. It is given back as well.
  absl::StatusOr<std::unique_ptr<PreparedStatement>> TakeOnce(
      std::string_view sql) {
    return Prepare(sql);
  }

 protected:
  Connection() = default;
  // An engine calls it before it closes.
  void DropPrepared() { prepared_.clear(); }

 private:
  virtual absl::StatusOr<std::unique_ptr<PreparedStatement>> Prepare(
      std::string_view sql) = 0;

  // By their SQL; null while in use.
  std::map<std::string, std::unique_ptr<PreparedStatement>, std::less<>>
      prepared_;
};

// Listens until it is destroyed.
class Listener {
 public:
  // Called on a thread of the listener with each text that another process
  // announces, and with nullopt when some may have been missed: after the
  // connection was lost, and now and then, as a pooler may pass on none.
  using Heard = std::function<void(const std::optional<std::string>& text)>;
  virtual ~Listener() = default;
};

// An open database that any thread may use.
class Database {
 public:
  // May run again, if the transaction that included it failed for another
  // reason.
  using Work = std::function<absl::Status(Connection*)>;
  using Done = std::function<void(const absl::Status&)>;

  virtual ~Database() = default;

  // Runs `work`, which opens one Transaction that fails or commits as a whole,
  // and waits until it is durable.
  virtual absl::Status Write(Work work) = 0;
  // Write without waiting. Writes of one thread are carried out in their order.
  // `done` is called once, on a thread of the database; it must be short, and
  // must neither read, nor wait for a write, nor take a lock that somebody
  // holds while waiting for one.
  virtual void BeginWrite(Work work, Done done) = 0;
  // Runs `query` on a single state of the database.
  virtual absl::Status Read(const Work& query) = 0;
  // Read of a `query` that runs one statement, which sees a single state by
  // itself: an engine that is a server needs no transaction for it.
  virtual absl::Status ReadOne(const Work& query) { return Read(query); }
  // Read for the work of the daemon itself: it never waits for reads of
  // callers.
  virtual absl::Status ReadForService(const Work& query) { return Read(query); }
  // A connection of the caller's own that only reads, for what takes long. The
  // database must outlive it.
  virtual absl::StatusOr<std::unique_ptr<Connection>> OpenReader() = 0;

  // Null for an engine of one process.
  virtual std::unique_ptr<Listener> Listen(const Listener::Heard& /*heard*/) {
    return nullptr;
  }

  // Null for an engine that has tools of its own to back up and restore.
  virtual DatabaseCopies* copies() { return nullptr; }
};

// Runs `work` for a Database: what it throws becomes its error,
// RESOURCE_EXHAUSTED for a lack of memory.
absl::Status RunGuarded(const Database::Work& work, Connection* connection);

}  // namespace selfcal::server
