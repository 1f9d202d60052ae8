// One daemon for one state folder. The lock is taken before the database is
// opened and before the socket of another daemon could be replaced; the kernel
// releases it when the process ends, however it ends.
#pragma once

#include <absl/status/statusor.h>

#include <filesystem>

namespace selfcal::server {

class StateLock {
 public:
  // Creates the folder, if need be, for its owner alone, locks <folder>/lock
  // and writes the process id into it. FAILED_PRECONDITION if another process
  // holds it (the message tells which); UNAVAILABLE if the folder or the file
  // cannot be created.
  static absl::StatusOr<StateLock> Take(const std::filesystem::path& folder);

  StateLock(StateLock&& other) noexcept;
  StateLock& operator=(StateLock&&) = delete;
  ~StateLock();

 private:
  explicit StateLock(int file) : file_(file) {}

  int file_;  // -1 once moved from
};

}  // namespace selfcal::server
