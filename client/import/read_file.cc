#include "client/import/read_file.h"

#include <fmt/format.h>

#include <cerrno>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <system_error>
#include <utility>

namespace selfcal::client {

absl::StatusOr<std::string> ReadFile(const std::string& path) {
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored)) {
    return absl::InvalidArgumentError(
        fmt::format("cannot read {}: it is a folder; name a file", path));
  }
  errno = 0;
  std::ifstream file(path, std::ios::binary);
  if (!file) {
    return absl::NotFoundError(fmt::format(
        "cannot read {}: {}", path, std::generic_category().message(errno)));
  }
  std::ostringstream text;
  // The insertion of an empty file fails, although it was read.
  if (file.peek() != std::ifstream::traits_type::eof()) text << file.rdbuf();
  if (file.bad() || !text) {
    return absl::UnknownError(fmt::format("cannot read {} to its end", path));
  }
  return std::move(text).str();
}

}  // namespace selfcal::client
