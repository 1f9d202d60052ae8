// Copies of a whole database as streams of bytes, while it is in use. For
// engines whose database is a file.
//
// Any thread may call; a copy blocks neither readers nor writers.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

namespace selfcal::server {

class Connection;

// A copy that arrives in pieces. Destroying it before Finish discards them.
class ArrivingCopy {
 public:
  virtual ~ArrivingCopy() = default;
  virtual absl::Status Append(std::string_view bytes) = 0;
  // Accepts the copy to replace the database at the next start, if this program
  // can open or migrate it and `verify` finds it whole; returns the name that
  // the present database then gets. `time_ns` is part of the name [ns since the
  // Unix epoch]. DATA_LOSS if it is damaged, FAILED_PRECONDITION if it is not a
  // database of this program.
  using Verify = std::function<absl::Status(Connection*)>;
  virtual absl::StatusOr<std::string> Finish(std::int64_t time_ns,
                                             const Verify& verify) = 0;
};

class DatabaseCopies {
 public:
  virtual ~DatabaseCopies() = default;

  // Copies one state of the database, in pieces of at most 1 MiB. CANCELLED if
  // `on_bytes` returned false. The copy takes as much disk space again until
  // the call ends.
  using OnBytes = std::function<bool(std::string_view)>;
  virtual absl::Status Export(const OnBytes& on_bytes) = 0;

  // FAILED_PRECONDITION while another copy arrives or waits for the next start.
  virtual absl::StatusOr<std::unique_ptr<ArrivingCopy>> BeginImport() = 0;
};

}  // namespace selfcal::server
