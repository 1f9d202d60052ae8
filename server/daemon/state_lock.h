// The lock that allows only one daemon per state folder. It is taken before the
// database is opened and before the socket of another daemon could be replaced;
// the kernel releases it when the process ends, however it ends.
#pragma once

#include <absl/status/statusor.h>

#include <filesystem>

namespace selfcal::server {

class StateLock {
 public:
  // Creates the folder if it does not exist, accessible by its owner only,
  // locks <folder>/lock and writes the process id into it. FAILED_PRECONDITION,
  // with the process id, if another process holds the lock; UNAVAILABLE if the
  // folder or the file cannot be created.
  static absl::StatusOr<StateLock> Take(const std::filesystem::path& folder);

  StateLock(StateLock&& other) noexcept;
  StateLock& operator=(StateLock&&) = delete;
  ~StateLock();

 private:
  explicit StateLock(int file) : file_(file) {}

  int file_;  // -1 after a move
};

}  // namespace selfcal::server
