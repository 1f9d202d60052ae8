// A daemon's writer, killed at random moments: what it acknowledged is there,
// and what is there is whole.
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <random>
#include <thread>

#include "server/store/statement.h"
#include "test/server/store/store_test.h"

namespace selfcal::server {
namespace {

constexpr int kSegments = 400;

double EntropyOf(std::int64_t index) {
  return static_cast<double>(index * 7919 % 101);
}

// Acknowledgements of the writer: one byte each, in order, put then score.
class KillTest : public StoreTest {
 protected:
  // Puts and scores one segment after the other, from the first that is
  // missing.
  [[noreturn]] void Write(const Rig& rig, int acknowledgements) {
    auto store = GetParam().open(folder_);
    if (!store.ok()) _exit(2);
    for (int k = 0; k < kSegments; ++k) {
      const char byte = static_cast<char>(k % 128);
      if (!(*store)->PutSegment(rig.id, Segment(k)).ok() ||
          write(acknowledgements, &byte, 1) != 1) {
        _exit(3);
      }
      const auto commit = (*store)->CommitScore(
          rig.id, {"s", k}, FakeInformation(rig, EntropyOf(k)));
      if (!commit.ok() || write(acknowledgements, &byte, 1) != 1) _exit(4);
    }
    for (;;) pause();
  }

  // Number of acknowledgements until the writer was killed.
  int RunAndKill(const Rig& rig, std::chrono::microseconds after) {
    int ends[2];
    EXPECT_EQ(pipe(ends), 0);
    const pid_t child = fork();
    if (child == 0) {
      close(ends[0]);
      Write(rig, ends[1]);
    }
    close(ends[1]);
    char byte = 0;
    int count = 0;
    if (read(ends[0], &byte, 1) == 1) ++count;  // it is at work
    std::this_thread::sleep_for(after);
    kill(child, SIGKILL);
    while (read(ends[0], &byte, 1) == 1) ++count;
    close(ends[0]);
    int status = 0;
    EXPECT_EQ(waitpid(child, &status, 0), child);
    EXPECT_TRUE(WIFSIGNALED(status)) << "exit " << WEXITSTATUS(status);
    return count;
  }

  void ExpectWhole(const Rig& rig, int acknowledged) {
    const auto segments = store_->ListSegments(rig.id, {1000, ""});
    ASSERT_TRUE(segments.ok()) << segments.status();
    const int stored = static_cast<int>(segments->items.size());
    int scored = 0;
    std::vector<Table> expected = MakeTables(rig);
    for (auto item = segments->items.rbegin(); item != segments->items.rend();
         ++item) {
      if (item->state != SegmentState::kScored) continue;
      ++scored;
      for (Table& table : expected) {
        Offer({item->key, item->sequence, EntropyOf(item->key.index), 5.0},
              rig.min_gain_nats,
              &table);
      }
    }
    // Every second acknowledgement is that of a put.
    EXPECT_GE(stored, (acknowledged + 1) / 2);
    EXPECT_GE(scored, acknowledged / 2);
    EXPECT_LE(stored + scored, acknowledged + 1);
    const auto tables = store_->GetTables(rig.id);
    ASSERT_TRUE(tables.ok());
    for (std::size_t g = 0; g < expected.size(); ++g) {
      EXPECT_EQ((*tables)[g].entries, expected[g].entries);
      EXPECT_EQ((*tables)[g].scored, expected[g].scored);
    }
    for (const StoredSegment& segment : segments->items) {
      if (segment.has_data) {
        EXPECT_TRUE(store_->GetSegmentData(rig.id, segment.key).ok());
      }
    }
    const auto runs = store_->ListUnfinishedRuns();
    ASSERT_TRUE(runs.ok());
    EXPECT_EQ(runs->size(), scored >= rig.table_size ? 1u : 0u);
  }

  void ExpectIntact() {
    store_.reset();
    auto db =
        Connection::Open(folder_.File("selfcal.db"), SQLITE_OPEN_READWRITE);
    ASSERT_TRUE(db.ok());
    Statement check(&*db, "PRAGMA integrity_check");
    ASSERT_TRUE(check.Next());
    EXPECT_EQ(check.Text(0), "ok");
    Statement keys(&*db, "PRAGMA foreign_key_check");
    EXPECT_FALSE(keys.Next());
  }
};
SELFCAL_STORE_TEST_SUITE(KillTest);

TEST_P(KillTest, EveryAcknowledgedSegmentSurvives) {
  std::mt19937 random(11);
  std::uniform_int_distribution<int> delay_us(0, 60'000);
  for (int trial = 0; trial < 20; ++trial) {
    SCOPED_TRACE(trial);
    store_.reset();
    std::filesystem::remove(folder_.File("selfcal.db"));
    Reopen();
    const Rig rig = CreateTestRig("a");
    store_.reset();
    const int acknowledged =
        RunAndKill(rig, std::chrono::microseconds(delay_us(random)));
    EXPECT_GT(acknowledged, 0);
    Reopen();
    ExpectWhole(rig, acknowledged);
    ExpectIntact();
    if (HasFailure()) return;
  }
}

TEST_P(KillTest, KilledCreationLeavesNothingOrAWholeDatabase) {
  std::mt19937 random(12);
  std::uniform_int_distribution<int> delay_us(0, 30'000);
  for (int trial = 0; trial < 20; ++trial) {
    SCOPED_TRACE(trial);
    store_.reset();
    for (const char* suffix : {"", "-wal", "-shm"}) {
      std::filesystem::remove(folder_.File("selfcal.db") + suffix);
    }
    const pid_t child = fork();
    if (child == 0) {
      const auto store = GetParam().open(folder_);
      for (;;) pause();
    }
    std::this_thread::sleep_for(std::chrono::microseconds(delay_us(random)));
    kill(child, SIGKILL);
    ASSERT_EQ(waitpid(child, nullptr, 0), child);
    Reopen();
    ASSERT_TRUE(store_->CreateRig(TestRig("a")).ok());
  }
}

}  // namespace
}  // namespace selfcal::server
