// A file that gets its name when it is whole and on the disk, not before.
#pragma once

#include <absl/status/status.h>

#include <string>
#include <string_view>

namespace selfcal::client {

// Until Commit it lies beside its place as PATH.XXXXXX, for its owner alone,
// and goes with this object. Not thread-safe.
class NewFile {
 public:
  NewFile() = default;
  ~NewFile();
  NewFile(const NewFile&) = delete;
  NewFile& operator=(const NewFile&) = delete;

  // ALREADY_EXISTS if there is one and `overwrite` is false;
  // FAILED_PRECONDITION for what no file can be put in place of, and for a
  // folder that cannot be written to. Once.
  absl::Status Open(const std::string& path, bool overwrite);

  absl::Status Append(std::string_view bytes);

  // Syncs it, gives it its name, and syncs that. ALREADY_EXISTS if another file
  // took the name in the meantime.
  absl::Status Commit();

 private:
  absl::Status Failed(std::string_view what) const;
  absl::Status Rename() const;

  std::string path_;
  std::string unfinished_;  // empty once it has its name
  bool overwrite_ = false;
  int file_ = -1;
};

}  // namespace selfcal::client
