// The lock that allows only one daemon per state folder. It is taken before the
// database is opened and before the socket of another daemon could be replaced;
// the kernel releases it when the process ends, however it ends.
#pragma once

#include <absl/status/statusor.h>

#include <filesystem>
#include <string>
#include <utility>

namespace selfcal::server {

class StateLock {
 public:
  // Creates the folder if it does not exist, accessible by its owner only,
  // locks <folder>/lock and writes the process id into it. FAILED_PRECONDITION,
  // with the process id, if another process holds the lock; UNAVAILABLE if the
  // folder or the file cannot be created.
  static absl::StatusOr<StateLock> Take(const std::filesystem::path& folder);

  // True if <folder>/lock is still the file that is locked. If the folder was
  // removed or replaced, another daemon could use it, and what this one writes
  // is lost.
  bool IsInPlace() const;

  StateLock(StateLock&& other) noexcept;
  StateLock& operator=(StateLock&&) = delete;
  ~StateLock();

 private:
  StateLock(std::string path, int file) : path_(std::move(path)), file_(file) {}

  std::string path_;
  int file_;  // -1 after a move
};

}  // namespace selfcal::server
