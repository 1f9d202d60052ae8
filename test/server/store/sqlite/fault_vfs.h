// A disk that fails: an SQLite VFS over the default one, made the default while
// it lives. It counts writes and syncs of databases, their logs and journals,
// fails or kills at the one that a test asks for, runs full, and records what
// reaches the disk and when.
#pragma once

#include <sqlite3.h>

#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <vector>

namespace selfcal::server {

// One thing that happened to a file, by its base name.
struct DiskOperation {
  enum class Kind { kWrite, kTruncate, kSync, kDelete, kMark };
  Kind kind = Kind::kMark;
  std::string file;
  std::int64_t offset = 0;  // of a write; the size of a truncation
  std::string bytes;        // of a write
  int mark = 0;             // of the test
};

// Use of the disk by files.
struct DiskUse {
  std::int64_t bytes = 0;  // written
  int syncs = 0;
  double write_s = 0;
  double sync_s = 0;

  DiskUse& operator+=(const DiskUse& other);
};

class FaultVfs {
 public:
  FaultVfs();
  ~FaultVfs();
  FaultVfs(const FaultVfs&) = delete;
  FaultVfs& operator=(const FaultVfs&) = delete;

  // Called before each write, truncation and sync with its number from 1 since
  // this call; what it returns other than SQLITE_OK is the outcome.
  using Fault = std::function<int(int number, DiskOperation::Kind kind)>;
  void SetFault(Fault fault);
  void Heal() { SetFault(nullptr); }

  // No file grows beyond this; 0: no limit.
  void SetMaxFileBytes(std::int64_t bytes);

  int operations() const;  // since SetFault
  // Use by the files whose names end so, since this was made.
  DiskUse use(const std::string& suffix) const;
  int syncs(const std::string& suffix) const { return use(suffix).syncs; }

  void StartRecording();
  void Mark(int mark);
  std::vector<DiskOperation> TakeRecording();

  // For the shim of a file.
  int Before(const std::string& file,
             DiskOperation::Kind kind,
             std::int64_t offset,
             const void* bytes,
             std::int64_t size);
  void Used(const std::string& file, const DiskUse& use);
  void Deleted(const std::string& file);
  sqlite3_vfs* real() const { return real_; }

 private:
  sqlite3_vfs* real_ = nullptr;
  sqlite3_vfs shim_{};

  mutable std::mutex mutex_;  // guards what follows
  Fault fault_;
  int operations_ = 0;
  std::int64_t max_file_bytes_ = 0;
  std::map<std::string, DiskUse> use_;
  bool recording_ = false;
  std::vector<DiskOperation> recorded_;
};

}  // namespace selfcal::server
