// The connection that writes to an SQLite file, and the write-ahead log of what
// it has committed. One thread at a time may use it.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "server/store/sqlite/file_identity.h"
#include "server/store/sqlite/sqlite_connection.h"

namespace selfcal::server {

class SqliteWriter {
 public:
  using Opener =
      std::function<absl::StatusOr<std::unique_ptr<SqliteConnection>>()>;

  // `open` opens the file at `path` for writing.
  SqliteWriter(std::string path, Opener open);
  SqliteWriter(const SqliteWriter&) = delete;
  SqliteWriter& operator=(const SqliteWriter&) = delete;

  // Closes the connection, if there is one, and opens another.
  absl::Status Open();
  // SQLite moves the log into the file if no other connection is open.
  void Close() { connection_.reset(); }
  // Null unless it was opened.
  SqliteConnection* connection() const { return connection_.get(); }

  // After a commit, and before it is answered: whether it is in the files that
  // a restart will find.
  bool IsInPlace();
  // Moves the log into the file if it is large. The connection must be open.
  absl::Status CheckpointIfLarge();

 private:
  const std::string path_;
  const Opener open_;
  std::unique_ptr<SqliteConnection> connection_;
  FileIdentity file_;
  std::optional<FileIdentity> log_;  // of the file, since the first commit
  int log_pages_ = 0;                // after the last commit
  std::int64_t checkpoint_pages_ = 0;
};

}  // namespace selfcal::server
