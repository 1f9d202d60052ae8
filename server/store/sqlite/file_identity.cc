#include "server/store/sqlite/file_identity.h"

#include <sys/stat.h>

#include <cerrno>
#include <system_error>

namespace selfcal::server {

absl::StatusOr<FileIdentity> IdentityOf(const std::string& path) {
  struct stat file {};
  if (stat(path.c_str(), &file) != 0) {
    return absl::UnavailableError("cannot find " + path + ": " +
                                  std::generic_category().message(errno));
  }
  return FileIdentity{file.st_dev, file.st_ino};
}

bool StillNames(const std::string& path, const FileIdentity& file) {
  const auto now = IdentityOf(path);
  return now.ok() && *now == file;
}

}  // namespace selfcal::server
