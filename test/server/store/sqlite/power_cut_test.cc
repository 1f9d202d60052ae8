// The power goes at any instant: what reached the disk is replayed up to each
// operation, and what was not yet synced is lost, kept or torn. Every
// acknowledged segment is there.
#include <map>
#include <random>

#include "test/promise.h"
#include "test/server/store/sqlite/fault_vfs.h"
#include "test/server/store/sqlite/sqlite_test.h"
#include "test/support/files.h"

namespace selfcal::server {
namespace {

using Kind = DiskOperation::Kind;

constexpr std::size_t kSector = 512;

// A file as a disk holds it: what is synced for sure, and what came since.
class DiskFile {
 public:
  explicit DiskFile(std::string bytes) : synced_(std::move(bytes)) {}

  void Apply(const DiskOperation& operation) {
    if (operation.kind == Kind::kSync) {
      for (const DiskOperation& one : pending_) Carry(one, &synced_);
      pending_.clear();
    } else {
      pending_.push_back(operation);
    }
  }

  // After a cut: of what was not synced each sector is there or not.
  template <typename Random>
  std::string AfterCut(double kept, Random* random) const {
    std::bernoulli_distribution keep(kept);
    std::string bytes = synced_;
    for (const DiskOperation& one : pending_) {
      if (one.kind == Kind::kTruncate) {
        if (keep(*random)) Carry(one, &bytes);
        continue;
      }
      for (std::size_t at = 0; at < one.bytes.size(); at += kSector) {
        if (!keep(*random)) continue;
        DiskOperation sector = one;
        sector.offset += static_cast<std::int64_t>(at);
        sector.bytes = one.bytes.substr(at, kSector);
        Carry(sector, &bytes);
      }
    }
    return bytes;
  }

 private:
  static void Carry(const DiskOperation& operation, std::string* bytes) {
    const auto offset = static_cast<std::size_t>(operation.offset);
    if (operation.kind == Kind::kTruncate) {
      bytes->resize(offset);
      return;
    }
    bytes->resize(std::max(bytes->size(), offset + operation.bytes.size()));
    bytes->replace(offset, operation.bytes.size(), operation.bytes);
  }

  std::string synced_;
  std::vector<DiskOperation> pending_;
};

class PowerCutTest : public SqliteTest {
 protected:
  ~PowerCutTest() override { store_.reset(); }

  // A rig on the disk, everything synced.
  void Prepare() {
    ASSERT_TRUE(Open().ok());
    ASSERT_TRUE(domain_->CreateRig(rig_).ok());
    store_.reset();
    before_ = ReadBytes(Path());
  }

  // Puts and scores with two closes on the way; the mark k + 1 says that
  // segment k was acknowledged.
  std::vector<DiskOperation> Record(int segments) {
    FaultVfs vfs;
    vfs.StartRecording();
    for (int k = 0; k < segments; ++k) {
      if (k % 4 == 0) {  // a stop moves the log into the file
        store_.reset();
        EXPECT_TRUE(Open().ok());
      }
      EXPECT_TRUE(domain_->PutSegment("a", Segment(k)).ok());
      vfs.Mark(k + 1);
      EXPECT_TRUE(domain_
                      ->CommitScore(
                          "a", {"s", k}, FakeInformation(rig_, 10.0 - k, 5, k))
                      .ok());
    }
    store_.reset();
    return vfs.TakeRecording();
  }

  // The disk after the first `count` operations and a cut; returns what was
  // acknowledged.
  template <typename Random>
  int Restore(const std::vector<DiskOperation>& operations,
              std::size_t count,
              double kept,
              Random* random) {
    std::map<std::string, DiskFile> files;
    files.emplace("selfcal.db", DiskFile(before_));
    int acknowledged = 0;
    for (std::size_t k = 0; k < count; ++k) {
      const DiskOperation& one = operations[k];
      if (one.kind == Kind::kMark) {
        acknowledged = one.mark;
      } else if (one.kind == Kind::kDelete) {
        // Only a log that was moved into the synced file is deleted.
        files.erase(one.file);
      } else {
        files.try_emplace(one.file, DiskFile("")).first->second.Apply(one);
      }
    }
    for (const char* suffix : {"", "-wal", "-shm"}) {
      std::filesystem::remove(Path() + suffix);
    }
    for (const auto& [name, file] : files) {
      WriteBytes(folder_.File(name), file.AfterCut(kept, random));
    }
    return acknowledged;
  }

  int Missing(int acknowledged) {
    int missing = 0;
    for (int k = 0; k < acknowledged; ++k) {
      const auto segment = store_->GetSegment("a", {"s", k});
      const bool data_lost = segment.ok() && segment->has_data &&
                             !store_->GetSegmentData("a", {"s", k}).ok();
      if (!segment.ok() || data_lost) ++missing;
    }
    return missing;
  }

  std::string before_;
};

TEST_F(PowerCutTest, EveryAcknowledgedSegmentIsThereAfterACutAtAnyInstant) {
  Promise promise("an acknowledged segment survives a power cut");
  Prepare();
  const std::vector<DiskOperation> operations = Record(8);
  ASSERT_GT(operations.size(), 50u);
  std::mt19937 random(7);
  // Every instant in turn, with nothing, half and all of what was not synced.
  const int trials = Trials(150);
  const std::size_t instants = operations.size() + 1;
  for (int trial = 0; trial < trials; ++trial) {
    const std::size_t count = trials < static_cast<int>(instants)
                                  ? static_cast<std::size_t>(trial) * instants /
                                        static_cast<std::size_t>(trials)
                                  : static_cast<std::size_t>(trial) % instants;
    constexpr double kKept[] = {0.0, 0.5, 1.0, 0.9};
    const double kept = kKept[trial % 4];
    SCOPED_TRACE("instant " + std::to_string(count) + ", kept " +
                 std::to_string(kept));
    const int acknowledged = Restore(operations, count, kept, &random);
    ++promise.trials;
    const absl::Status opened = Open();
    EXPECT_TRUE(opened.ok()) << opened;
    if (!opened.ok()) {
      ++promise.lost;
      break;
    }
    promise.lost += Missing(acknowledged);
    store_.reset();
    EXPECT_EQ(IntegrityOf(Path()), "ok");
    if (HasFailure()) break;
  }
}

// The shim would notice: without the syncs, segments are lost.
TEST_F(PowerCutTest, WithoutSyncsSegmentsWouldBeLost) {
  Prepare();
  std::vector<DiskOperation> operations = Record(3);
  std::erase_if(operations,
                [](const auto& one) { return one.kind == Kind::kSync; });
  std::erase_if(operations,
                [](const auto& one) { return one.kind == Kind::kDelete; });
  std::mt19937 random(8);
  const int acknowledged =
      Restore(operations, operations.size(), /*kept=*/0.0, &random);
  ASSERT_EQ(acknowledged, 3);
  ASSERT_TRUE(Open().ok());
  EXPECT_EQ(Missing(acknowledged), 3);
}

}  // namespace
}  // namespace selfcal::server
