// Payloads on disk while they cannot be sent: a folder with one file for each,
// in the order of their numbers, bounded in bytes, and taken up by the next
// process that opens it.
//
//   00000000000000000042.segment   one payload (spool_file.h)
//   00000000000000000042.damaged   set aside: not what was written
//   lock                           held while a process has it open
//
// Not thread-safe.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

namespace selfcal::client {

class Spool {
 public:
  // Makes the folder if it is missing. ALREADY_EXISTS if another process or
  // object has it open, UNAVAILABLE for errors of the disk.
  static absl::StatusOr<std::unique_ptr<Spool>> Open(
      const std::filesystem::path& folder, std::uint64_t max_bytes);
  ~Spool();
  Spool(const Spool&) = delete;
  Spool& operator=(const Spool&) = delete;

  // Larger than that of every payload that is there.
  std::uint64_t next_number() const;

  // On success the payload is on disk. RESOURCE_EXHAUSTED if it would take more
  // than max_bytes, for which files that are set aside make room, or if the
  // disk is full; UNAVAILABLE for its other errors.
  absl::Status Write(std::uint64_t number, std::string_view payload);

  // Number of the oldest payload from `number` on.
  std::optional<std::uint64_t> FirstFrom(std::uint64_t number) const;

  // DATA_LOSS if it is damaged; UNAVAILABLE if it cannot be read.
  absl::StatusOr<std::string> Read(std::uint64_t number) const;

  // The payload has done its duty.
  void Remove(std::uint64_t number);
  // It is of no use, but kept for who wants to know why.
  void SetAside(std::uint64_t number);

  std::size_t size() const { return files_.size(); }  // payloads
  std::uint64_t bytes() const { return bytes_; }      // with those set aside

 private:
  Spool(std::filesystem::path folder, std::uint64_t max_bytes, int lock);
  absl::Status TakeUp();
  void MakeRoom(std::uint64_t bytes);
  std::filesystem::path Path(std::uint64_t number, const char* suffix) const;

  const std::filesystem::path folder_;
  const std::uint64_t max_bytes_;
  const int lock_;
  std::map<std::uint64_t, std::uint64_t> files_;    // number -> bytes
  std::map<std::uint64_t, std::uint64_t> damaged_;  // the same
  std::uint64_t bytes_ = 0;
  std::uint64_t next_number_ = 1;
};

}  // namespace selfcal::client
