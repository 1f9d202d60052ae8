// The care of what is stored, while it is in use: check, back up, restore. An
// engine that has tools of its own for this offers none.
//
// Any thread may call; a check or a backup holds up neither those who read nor
// those who write. Errors as of Store.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

namespace selfcal::server {

struct StoreProblem {
  std::string place;  // e.g. "payloads, row 7"
  std::string description;
};

struct CheckSummary {
  std::int64_t bytes = 0;      // of the database
  std::int64_t checksums = 0;  // of blobs, compared
  std::int64_t payloads = 0;   // segments' data, decoded
  std::int64_t problems = 0;
};

struct BackupSummary {
  std::int64_t bytes = 0;
  std::string sha256;  // 32 bytes
};

// A database that arrives in pieces. Destroying it unfinished leaves nothing.
class Restoration {
 public:
  virtual ~Restoration() = default;
  virtual absl::Status Append(std::string_view bytes) = 0;
  // DATA_LOSS if the bytes are not those of `sha256` or the database is
  // damaged; FAILED_PRECONDITION if it is not one of this program. Otherwise it
  // takes the place of the present one at the next start; returns the name that
  // the present one then gets.
  virtual absl::StatusOr<std::string> Finish(std::string_view sha256) = 0;
};

class StoreMaintenance {
 public:
  virtual ~StoreMaintenance() = default;

  // The whole database: its structure, references, and every checksum. The
  // callbacks end what they are called from by returning false (CANCELLED).
  using OnProblem = std::function<bool(const StoreProblem&)>;
  virtual absl::StatusOr<CheckSummary> Check(const OnProblem& on_problem) = 0;

  // A copy of one instant, in pieces of at most a MiB. Needs as much space
  // again on the disk while it is read.
  using OnBytes = std::function<bool(std::string_view)>;
  virtual absl::StatusOr<BackupSummary> Backup(const OnBytes& on_bytes) = 0;

  // FAILED_PRECONDITION while another is under way, or waits for the next
  // start.
  virtual absl::StatusOr<std::unique_ptr<Restoration>> BeginRestore() = 0;
};

}  // namespace selfcal::server
