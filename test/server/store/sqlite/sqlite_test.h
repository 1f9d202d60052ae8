// For tests of what only SQLite promises: they reach around the store, into its
// file.
#pragma once

#include <string>

#include "test/server/store/sqlite/open_sqlite_store.h"
#include "test/server/store/sqlite/tamper.h"
#include "test/server/store/store_test.h"
#include "test/support/temp_folder.h"

namespace selfcal::server {

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

  // In memory: the tests simulate the disk themselves.
  TempFolder folder_;
  const Rig rig_ = TestRig("a");
  std::unique_ptr<Store> store_;
  std::optional<Domain> domain_;
};

}  // namespace selfcal::server
