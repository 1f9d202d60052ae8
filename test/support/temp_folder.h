// Folders for one test, removed at its end with all that they contain. Each has
// a name of its own, so that tests may run at the same time.
#pragma once

#include <stdlib.h>

#include <filesystem>
#include <stdexcept>
#include <string>
#include <system_error>

namespace selfcal {

// Where temporary folders are: in $TMPDIR if it is set, else in memory, where
// syncs cost nothing, if the machine has a folder there with a GiB to spare.
inline std::filesystem::path ParentOfTempFolders() {
  const std::filesystem::path memory = "/dev/shm";
  std::error_code error;
  const auto space = std::filesystem::space(memory, error);
  return !error && space.available >= (1 << 30) && getenv("TMPDIR") == nullptr
             ? memory
             : std::filesystem::temp_directory_path();
}

class TempFolder {
 public:
  // Throws std::runtime_error if it cannot be created.
  explicit TempFolder(
      const std::filesystem::path& parent = ParentOfTempFolders()) {
    std::string name = parent / "selfcal-XXXXXX";
    if (mkdtemp(name.data()) == nullptr) {
      throw std::runtime_error("cannot create " + name);
    }
    path_ = name;
  }
  ~TempFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TempFolder(const TempFolder&) = delete;
  TempFolder& operator=(const TempFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }
  std::string File(const std::string& name) const { return path_ / name; }

 private:
  std::filesystem::path path_;
};

}  // namespace selfcal
