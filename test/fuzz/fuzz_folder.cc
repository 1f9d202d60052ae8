#include "test/fuzz/fuzz_folder.h"

#include <unistd.h>

#include <string>
#include <system_error>

namespace selfcal {
namespace {

class Folder {
 public:
  Folder() { std::filesystem::create_directories(path_); }
  ~Folder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  const std::filesystem::path& path() const { return path_; }

 private:
  const std::filesystem::path path_ =
      std::filesystem::temp_directory_path() /
      ("selfcal-fuzz-" + std::to_string(::getpid()));
};

}  // namespace

const std::filesystem::path& FuzzFolder() {
  static const Folder folder;
  return folder.path();
}

}  // namespace selfcal
