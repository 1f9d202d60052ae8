#include "server/store/driver/transaction.h"

#include "server/store/driver/statement.h"

namespace selfcal::server {

Transaction::Transaction(Connection* connection)
    : connection_(connection), nested_(connection->in_transaction()) {
  status_ =
      Statement(connection_,
                nested_ ? "SAVEPOINT part" : connection_->dialect().begin_write)
          .Run();
  open_ = status_.ok();
}

Transaction::~Transaction() {
  // After some errors the engine has rolled back by itself.
  if (open_ && connection_->in_transaction()) {
    connection_
        ->Execute(nested_ ? "ROLLBACK TO SAVEPOINT part; RELEASE SAVEPOINT part"
                          : "ROLLBACK")
        .IgnoreError();
  }
}

absl::Status Transaction::Commit() {
  absl::Status status =
      Statement(connection_, nested_ ? "RELEASE SAVEPOINT part" : "COMMIT")
          .Run();
  if (status.ok()) {
    open_ = false;
  }
  return status;
}

Snapshot::Snapshot(Connection* connection)
    : connection_(connection),
      status_(Statement(connection, connection->dialect().begin_read).Run()) {}

Snapshot::~Snapshot() {
  if (status_.ok() && connection_->in_transaction()) {
    connection_->Execute("COMMIT").IgnoreError();
  }
}

}  // namespace selfcal::server
