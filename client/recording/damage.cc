#include "client/recording/damage.h"

#include <fmt/format.h>

#include <utility>

namespace selfcal::client {

Damage::Damage(std::string path) : path_(std::move(path)) {}

void Damage::Chunk(std::uint64_t offset, const absl::Status& reason) {
  if (chunks_++ > 0) return;
  first_chunk_ = fmt::format(
      "at byte {} first: {}", offset, std::string(reason.message()));
}

void Damage::CutOff(std::uint64_t offset,
                    std::uint64_t file_size,
                    const absl::Status& reason) {
  cut_off_ = fmt::format(
      "cut off or damaged at byte {} of {}, and not read "
      "from there on: {}",
      offset,
      file_size,
      std::string(reason.message()));
}

void Damage::Report(std::vector<std::string>* problems) const {
  if (chunks_ > 0) {
    problems->push_back(fmt::format(
        "{}: chunks that are damaged are left out, or their rest: {}, {}",
        path_,
        chunks_,
        first_chunk_));
  }
  if (!cut_off_.empty()) {
    problems->push_back(fmt::format("{}: {}", path_, cut_off_));
  }
}

}  // namespace selfcal::client
