// A folder that keeps payloads while they cannot be sent: one file for each, in
// the order of their numbers, with a limit on the bytes. The next process that
// opens the folder continues with them.
//
//   00000000000000000042.segment   one payload (spool_file.h)
//   00000000000000000042.damaged   quarantined: differs from what was written
//   lock                           held while a process has the folder open
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
  // Creates the folder if it is missing. ALREADY_EXISTS if another process or
  // object has it open, UNAVAILABLE for disk errors.
  static absl::StatusOr<std::unique_ptr<Spool>> Open(
      const std::filesystem::path& folder, std::uint64_t max_bytes);
  ~Spool();
  Spool(const Spool&) = delete;
  Spool& operator=(const Spool&) = delete;

  // Larger than the number of every payload in the folder.
  std::uint64_t next_number() const;

  // Writes a payload; when it returns OK, the payload is on disk. Quarantined
  // files are deleted to make room. RESOURCE_EXHAUSTED if the folder would
  // still exceed max_bytes or the disk is full; UNAVAILABLE for other disk
  // errors.
  absl::Status Write(std::uint64_t number, std::string_view payload);

  // Returns the number of the oldest payload from `number` on.
  std::optional<std::uint64_t> FirstFrom(std::uint64_t number) const;

  // Reads a payload. DATA_LOSS if it is damaged; UNAVAILABLE if it cannot be
  // read.
  absl::StatusOr<std::string> Read(std::uint64_t number) const;

  // Deletes a payload that is no longer needed.
  void Remove(std::uint64_t number);
  // Takes a damaged payload out of use, but keeps its file for a diagnosis.
  void Quarantine(std::uint64_t number);

  std::size_t size() const { return files_.size(); }  // payloads
  std::uint64_t bytes() const { return bytes_; }      // with quarantined files

 private:
  Spool(std::filesystem::path folder, std::uint64_t max_bytes, int lock);
  absl::Status Recover();
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
