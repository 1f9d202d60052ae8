// A disk that fails at any one write or sync: nothing is acknowledged that is
// not there afterwards, and the store goes on once the disk does.
#include <chrono>
#include <filesystem>
#include <fstream>
#include <set>
#include <thread>

#include "test/promise.h"
#include "test/server/store/sqlite/fault_vfs.h"
#include "test/server/store/sqlite/sqlite_test.h"
#include "test/support/eventually.h"

namespace selfcal::server {
namespace {

using Kind = DiskOperation::Kind;

constexpr int kSegments = 3;

class IoFaultTest : public SqliteTest {
 protected:
  ~IoFaultTest() override { store_.reset(); }

  void StartAnew() {
    store_.reset();
    for (const char* suffix : {"", "-wal", "-shm"}) {
      std::filesystem::remove(Path() + suffix);
    }
    ASSERT_TRUE(Open().ok());
    ASSERT_TRUE(domain_->CreateRig(rig_).ok());
  }

  // As StartAnew, sooner: from a copy of what that leaves.
  void StartFromCopy() {
    const std::string ready = ready_.File("ready");
    if (!std::filesystem::exists(ready)) {
      StartAnew();
      store_.reset();
      std::filesystem::copy_file(Path(), ready);
    }
    store_.reset();
    ASSERT_FALSE(std::filesystem::exists(Path() + "-wal"));
    std::filesystem::copy_file(
        ready, Path(), std::filesystem::copy_options::overwrite_existing);
    ASSERT_TRUE(Open().ok());
  }

  // Puts and scores; what was acknowledged.
  std::set<int> PutAndScore() {
    std::set<int> stored;
    for (int k = 0; k < kSegments; ++k) {
      if (domain_->PutSegment("a", Segment(k)).ok()) stored.insert(k);
    }
    for (const int k : stored) {
      const auto commit = domain_->CommitScore(
          "a", {"s", k}, FakeInformation(rig_, 1.0 + k, 5, k));
      EXPECT_TRUE(commit.ok() || absl::IsUnavailable(commit.status()))
          << commit.status();
    }
    return stored;
  }

  int Missing(const std::set<int>& stored) {
    int missing = 0;
    for (const int k : stored) {
      const auto segment = store_->GetSegment("a", {"s", k});
      if (!segment.ok()) ++missing;
      if (segment.ok() && segment->has_data &&
          !store_->GetSegmentData("a", {"s", k}).ok()) {
        ++missing;
      }
    }
    return missing;
  }

  // One trial for each operation on the disk; `lasting`: the disk stays as it
  // is until the store has given up.
  void FailEach(int code, bool lasting, Promise* promise) {
    for (int n = 1;; ++n) {
      SCOPED_TRACE("operation " + std::to_string(n));
      ASSERT_NO_FATAL_FAILURE(StartFromCopy());
      bool failed = false;
      vfs_.SetFault([&failed, n, code, lasting](int number, Kind kind) {
        const bool fails = lasting ? number >= n : number == n;
        failed = failed || fails;
        if (!fails) return SQLITE_OK;
        return kind == Kind::kSync ? SQLITE_IOERR_FSYNC : code;
      });
      const std::set<int> stored = PutAndScore();
      vfs_.Heal();
      if (!failed) break;
      ++promise->trials;
      // The same store serves again, by itself.
      EXPECT_TRUE(EventuallyServes());
      promise->lost += Missing(stored);
      store_.reset();
      EXPECT_EQ(IntegrityOf(Path()), "ok");
      ASSERT_TRUE(Open().ok());
      promise->lost += Missing(stored);
      for (int k = 0; k < kSegments; ++k) {
        const auto again = domain_->PutSegment("a", Segment(k));
        ASSERT_TRUE(again.ok()) << again.status();
        if (stored.contains(k)) {
          EXPECT_EQ(*again, PutVerdict::kDuplicate);
        }
      }
      if (HasFailure()) return;
    }
  }

  // A read is refused until the file was opened again and checked.
  bool EventuallyServes() {
    return Eventually([this] { return store_->GetRig("a").ok(); });
  }

  const TempFolder ready_;
  FaultVfs vfs_;
};

TEST_F(IoFaultTest, AnErrorOnceNeverAcknowledgesWhatIsLost) {
  Promise promise("an I/O error never acknowledges (once)");
  FailEach(SQLITE_IOERR_WRITE, /*lasting=*/false, &promise);
}

TEST_F(IoFaultTest, AnErrorThatLastsNeverAcknowledgesWhatIsLost) {
  Promise promise("an I/O error never acknowledges (lasting)");
  FailEach(SQLITE_IOERR_WRITE, /*lasting=*/true, &promise);
}

TEST_F(IoFaultTest, EveryAcknowledgedCommitWasSynced) {
  Promise promise("a sync for each acknowledged commit");
  StartAnew();
  const int segments = Trials(50);
  for (int k = 0; k < segments; ++k) {
    const int before = vfs_.syncs("-wal");
    ASSERT_TRUE(domain_->PutSegment("a", Segment(k)).ok());
    ++promise.trials;
    if (vfs_.syncs("-wal") < before + 1) ++promise.lost;
  }
}

TEST_F(IoFaultTest, AFullDiskRefusesKeepsWhatItHasAndRecovers) {
  Promise promise("a full disk refuses cleanly");
  for (int pages = 4; pages < 4 + Trials(12); ++pages) {
    SCOPED_TRACE(pages);
    StartAnew();
    const std::int64_t size = std::filesystem::file_size(Path() + "-wal");
    vfs_.SetMaxFileBytes(size + 4096 * pages);
    std::set<int> stored;
    absl::Status refused;
    for (int k = 0; k < 1000 && refused.ok(); ++k) {
      refused = domain_->PutSegment("a", Segment(k)).status();
      if (refused.ok()) stored.insert(k);
    }
    ++promise.trials;
    EXPECT_TRUE(absl::IsResourceExhausted(refused)) << refused;
    promise.lost += Missing(stored);
    vfs_.SetMaxFileBytes(0);
    const int next = static_cast<int>(stored.size());
    EXPECT_TRUE(domain_->PutSegment("a", Segment(next)).ok());
    stored.insert(next);
    store_.reset();
    EXPECT_EQ(IntegrityOf(Path()), "ok");
    ASSERT_TRUE(Open().ok());
    promise.lost += Missing(stored);
    if (HasFailure()) return;
  }
}

TEST_F(IoFaultTest, WhatIsDamagedAfterAnErrorIsNotServed) {
  StartAnew();
  for (int k = 0; k < 20; ++k) {
    ASSERT_TRUE(domain_->PutSegment("a", Segment(k)).ok());
  }
  store_.reset();  // all of it is in the file
  ASSERT_TRUE(Open().ok());
  // The disk comes back with other bytes in the middle of the file.
  const auto size = std::filesystem::file_size(Path());
  {
    std::fstream file(Path(), std::ios::binary | std::ios::in | std::ios::out);
    for (std::uintmax_t at = 4096; at < size; at += 4096) {
      file.seekp(static_cast<std::streamoff>(at));
      file.write("\x7f\x7f\x7f\x7f", 4);
    }
  }
  vfs_.SetFault([](int, Kind kind) {
    return kind == Kind::kSync ? SQLITE_IOERR_FSYNC : SQLITE_OK;
  });
  EXPECT_FALSE(domain_->PutSegment("a", Segment(20)).ok());
  vfs_.Heal();
  EXPECT_FALSE(domain_->PutSegment("a", Segment(21)).ok());
  EXPECT_FALSE(store_->GetRig("a").ok());
}

}  // namespace
}  // namespace selfcal::server
