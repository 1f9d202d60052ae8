// A file that appears under its name atomically, once it is complete and synced
// to disk.
#pragma once

#include <absl/status/status.h>

#include <string>
#include <string_view>

namespace selfcal::client {

// Before Commit the file has the name PATH.XXXXXX and is readable by its owner
// only; the destructor deletes it. Not thread-safe.
class NewFile {
 public:
  NewFile() = default;
  ~NewFile();
  NewFile(const NewFile&) = delete;
  NewFile& operator=(const NewFile&) = delete;

  // Opens the file; may be called once. ALREADY_EXISTS if a file exists and
  // `overwrite` is false; FAILED_PRECONDITION if the path is something that a
  // file cannot replace, or its folder is not writable.
  absl::Status Open(const std::string& path, bool overwrite);

  absl::Status Append(std::string_view bytes);

  // Syncs the file, renames it to its path, and syncs the folder.
  // ALREADY_EXISTS if another file with this name appeared in the meantime.
  absl::Status Commit();

 private:
  absl::Status Failed(std::string_view what) const;
  absl::Status Rename() const;

  std::string path_;
  std::string unfinished_;  // temporary path; empty after the rename
  bool overwrite_ = false;
  int file_ = -1;
};

}  // namespace selfcal::client
