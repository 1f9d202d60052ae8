// Damaged parts of a file of messages, as sentences.
#pragma once

#include <absl/status/status.h>

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace selfcal::client {

class Damage {
 public:
  explicit Damage(std::string path);

  // The chunk at a byte of the file cannot be read, or not to its end.
  void Chunk(std::uint64_t offset, const absl::Status& reason);
  // The file cannot be read from this byte on.
  void CutOff(std::uint64_t offset,
              std::uint64_t file_size,
              const absl::Status& reason);

  // Adds a sentence for each kind of damage.
  void Report(std::vector<std::string>* problems) const;

 private:
  const std::string path_;
  std::size_t chunks_ = 0;
  std::string first_chunk_;
  std::string cut_off_;
};

}  // namespace selfcal::client
