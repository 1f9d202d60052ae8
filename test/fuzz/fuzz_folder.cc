#include "test/fuzz/fuzz_folder.h"

#include <unistd.h>

#include <string>

namespace selfcal {

const std::filesystem::path& FuzzFolder() {
  static const std::filesystem::path folder = [] {
    auto path = std::filesystem::temp_directory_path() /
                ("selfcal-fuzz-" + std::to_string(::getpid()));
    std::filesystem::create_directories(path);
    return path;
  }();
  return folder;
}

}  // namespace selfcal
