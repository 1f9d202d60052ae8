// Which file a path names. An open file stays usable after its folder was
// removed or replaced, but what is written to it then is lost.
#pragma once

#include <absl/status/statusor.h>
#include <sys/types.h>

#include <string>

namespace selfcal::server {

struct FileIdentity {
  dev_t device = 0;
  ino_t inode = 0;

  friend bool operator==(const FileIdentity&, const FileIdentity&) = default;
};

// UNAVAILABLE if there is no such file.
absl::StatusOr<FileIdentity> IdentityOf(const std::string& path);

// Whether the path still names this file.
bool StillNames(const std::string& path, const FileIdentity& file);

}  // namespace selfcal::server
