// For tests of what only SQLite promises: they reach around the store, into its
// file.
#pragma once

#include <string>

#include "test/server/store/sqlite/open_sqlite_store.h"
#include "test/server/store/sqlite/tamper.h"
#include "test/server/store/store_test.h"

namespace selfcal::server {

// A folder in memory, where syncs are free: for tests that simulate the disk
// themselves.
class MemoryFolder {
 public:
  MemoryFolder() {
    const std::string parent =
        std::filesystem::exists("/dev/shm") ? "/dev/shm" : ::testing::TempDir();
    std::string pattern = parent + "/selfcal-XXXXXX";
    path_ = mkdtemp(pattern.data());
  }
  ~MemoryFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  MemoryFolder(const MemoryFolder&) = delete;
  MemoryFolder& operator=(const MemoryFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }
  std::string File(const std::string& name) const {
    return (path_ / name).string();
  }

 private:
  std::filesystem::path path_;
};

// A rig and segments whose answers a test keeps.
class SqliteTest : public ::testing::Test {
 protected:
  static MotionSegment Segment(std::int64_t index) {
    static const std::vector<MotionSegment> kSegments =
        TestSegments(TestRig("a"), 1);
    MotionSegment segment = kSegments.front();
    segment.key = {"s", index};
    return segment;
  }

  absl::Status Open(const DomainOptions& options = {}) {
    auto opened = OpenSqliteStore(Path(), options.quotas.max_database_bytes);
    if (!opened.ok()) return opened.status();
    store_ = *std::move(opened);
    domain_.emplace(store_.get(), options);
    return absl::OkStatus();
  }

  std::string Path() const { return folder_.File("selfcal.db"); }

  MemoryFolder folder_;
  const Rig rig_ = TestRig("a");
  std::unique_ptr<Store> store_;
  std::optional<Domain> domain_;
};

}  // namespace selfcal::server
