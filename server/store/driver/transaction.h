// Transactions on a connection.
#pragma once

#include <absl/status/status.h>

#include "server/store/driver/driver.h"

namespace selfcal::server {

// A transaction that writes; rolls back unless committed. Inside another
// transaction it is a savepoint: its rollback keeps the changes of the outer
// transaction, and its commit becomes durable with the outer one.
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

// Database::Write of `work`, which takes a Connection*, as one transaction.
template <typename Work>
absl::Status WriteInTransaction(Database* database, const Work& work) {
  return database->Write([&](Connection* db) -> absl::Status {
    Transaction transaction(db);
    if (!transaction.status().ok()) return transaction.status();
    const absl::Status status = work(db);
    return status.ok() ? transaction.Commit() : status;
  });
}

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

}  // namespace selfcal::server
