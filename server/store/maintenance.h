// Check, backup and restore of a database while it is in use.
//
// Any thread may call; a check or a backup blocks neither readers nor writers.
// Errors as for Store.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

#include "server/store/driver/store_problem.h"

namespace selfcal::server {

struct CheckSummary {
  std::int64_t bytes = 0;      // of the database
  std::int64_t checksums = 0;  // of blobs, verified
  std::int64_t payloads = 0;   // data of segments, decoded
  std::int64_t problems = 0;
};

struct BackupSummary {
  std::int64_t bytes = 0;
  std::string sha256;  // 32 bytes
};

// A restore in progress: a database that arrives in pieces. Destroying it
// before Finish discards them.
class Restoration {
 public:
  virtual ~Restoration() = default;
  virtual absl::Status Append(std::string_view bytes) = 0;
  // DATA_LOSS if `sha256` is not the checksum of the bytes or the database is
  // damaged; FAILED_PRECONDITION if it is not a database of this program.
  // Otherwise the database replaces the present one at the next start; returns
  // the name that the present one then gets, of which `time_ns` is a part [ns
  // since the Unix epoch].
  virtual absl::StatusOr<std::string> Finish(std::string_view sha256,
                                             std::int64_t time_ns) = 0;
};

class StoreMaintenance {
 public:
  virtual ~StoreMaintenance() = default;

  // Checks the whole database: its structure, references, and every checksum. A
  // callback that returns false ends the call it belongs to (CANCELLED).
  using OnProblem = std::function<bool(const StoreProblem&)>;
  virtual absl::StatusOr<CheckSummary> Check(const OnProblem& on_problem) = 0;

  // UNIMPLEMENTED, as for restoring, if the engine has tools of its own for it.

  // Copies one state of the database, in pieces of at most 1 MiB. The copy
  // takes as much disk space again until the call ends.
  using OnBytes = std::function<bool(std::string_view)>;
  virtual absl::StatusOr<BackupSummary> Backup(const OnBytes& on_bytes) = 0;

  // FAILED_PRECONDITION while another restore is in progress or waits for the
  // next start.
  virtual absl::StatusOr<std::unique_ptr<Restoration>> BeginRestore() = 0;
};

class Database;

// `database` must outlive it.
std::unique_ptr<StoreMaintenance> MakeMaintenance(Database* database);

}  // namespace selfcal::server
