// A daemon's writer, killed at random moments: what it acknowledged is there,
// and what is there is whole.
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <filesystem>
#include <random>
#include <thread>

#include "server/store/maintenance.h"
#include "test/promise.h"
#include "test/server/store/store_test.h"

namespace selfcal::server {
namespace {

constexpr int kSegments = 400;
constexpr int kStreams = 4;

double EntropyOf(std::int64_t index) {
  return static_cast<double>(index * 7919 % 101);
}

// Acknowledgements of the writer: one byte each, in order, put then score.
class KillTest : public StoreTest {
 protected:
  // Puts and scores one segment after the other, from the first that is
  // missing.
  [[noreturn]] void Write(const Rig& rig, int acknowledgements) {
    auto store = GetParam().open(folder_, 0);
    if (!store.ok()) _exit(2);
    Domain domain(store->get());
    for (int k = 0; k < kSegments; ++k) {
      const char byte = static_cast<char>(k % 128);
      if (!domain.PutSegment(rig.id, Segment(k)).ok() ||
          write(acknowledgements, &byte, 1) != 1) {
        _exit(3);
      }
      const auto commit = domain.CommitScore(
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

  // The same with four streams; each byte names the one whose next segment is
  // acknowledged.
  std::array<int, kStreams> RunGroupsAndKill(std::chrono::microseconds after) {
    int ends[2];
    EXPECT_EQ(pipe(ends), 0);
    const pid_t child = fork();
    if (child == 0) {
      close(ends[0]);
      WriteGroups(ends[1]);
    }
    close(ends[1]);
    std::array<int, kStreams> acknowledged{};
    char byte = 0;
    if (read(ends[0], &byte, 1) == 1)
      ++acknowledged[static_cast<unsigned char>(byte)];  // it is at work
    std::this_thread::sleep_for(after);
    kill(child, SIGKILL);
    while (read(ends[0], &byte, 1) == 1)
      ++acknowledged[static_cast<unsigned char>(byte)];
    close(ends[0]);
    int status = 0;
    EXPECT_EQ(waitpid(child, &status, 0), child);
    EXPECT_TRUE(WIFSIGNALED(status)) << "exit " << WEXITSTATUS(status);
    return acknowledged;
  }

  [[noreturn]] void WriteGroups(int acknowledgements) {
    auto store = GetParam().open(folder_, 0);
    if (!store.ok()) _exit(2);
    Domain domain(store->get());
    std::vector<std::thread> threads;
    for (int stream = 0; stream < kStreams; ++stream) {
      threads.emplace_back([&domain, stream, acknowledgements] {
        const std::string session = "stream" + std::to_string(stream);
        const char byte = static_cast<char>(stream);
        for (int k = 0; k < kSegments; ++k) {
          if (!domain.PutSegment("a", Segment(k, session)).ok() ||
              write(acknowledgements, &byte, 1) != 1) {
            _exit(3);
          }
        }
      });
    }
    for (;;) pause();
  }

  void Empty() {
    for (const auto& entry : std::filesystem::directory_iterator(
             std::filesystem::path(folder_.File("x")).parent_path())) {
      std::filesystem::remove_all(entry);
    }
  }
  void StartAnew() {
    store_.reset();
    Empty();
    Reopen();
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
    const auto summary =
        store_->maintenance()->Check([](const StoreProblem& problem) {
          ADD_FAILURE() << problem.place << ": " << problem.description;
          return true;
        });
    EXPECT_TRUE(summary.ok()) << summary.status();
  }
};
SELFCAL_STORE_TEST_SUITE(KillTest);

TEST_P(KillTest, EveryAcknowledgedSegmentSurvives) {
  Promise promise("an acknowledged segment survives a kill");
  std::mt19937 random(11);
  std::uniform_int_distribution<int> delay_us(0, 60'000);
  const int trials = Trials(20);
  for (int trial = 0; trial < trials; ++trial) {
    SCOPED_TRACE(trial);
    StartAnew();
    const Rig rig = CreateTestRig("a");
    store_.reset();
    const int acknowledged =
        RunAndKill(rig, std::chrono::microseconds(delay_us(random)));
    EXPECT_GT(acknowledged, 0);
    ++promise.trials;
    Reopen();
    ExpectWhole(rig, acknowledged);
    ExpectIntact();
    if (HasFailure()) {
      ++promise.lost;
      return;
    }
  }
}

// Four streams at once, so that commits are shared.
TEST_P(KillTest, EveryAcknowledgedSegmentOfAGroupSurvives) {
  Promise promise("an acknowledged segment survives a kill (group commit)");
  std::mt19937 random(13);
  std::uniform_int_distribution<int> delay_us(0, 60'000);
  const int trials = Trials(20);
  for (int trial = 0; trial < trials; ++trial) {
    SCOPED_TRACE(trial);
    StartAnew();
    CreateTestRig("a");
    store_.reset();
    const std::array<int, kStreams> acknowledged =
        RunGroupsAndKill(std::chrono::microseconds(delay_us(random)));
    ++promise.trials;
    Reopen();
    for (int stream = 0; stream < kStreams; ++stream) {
      for (int k = 0; k < acknowledged[stream]; ++k) {
        const SegmentKey key{"stream" + std::to_string(stream), k};
        if (!store_->GetSegmentData("a", key).ok()) ++promise.lost;
      }
    }
    ExpectIntact();
    if (HasFailure()) return;
  }
}

TEST_P(KillTest, KilledCreationLeavesNothingOrAWholeDatabase) {
  Promise promise("a killed creation leaves nothing or a whole database");
  std::mt19937 random(12);
  std::uniform_int_distribution<int> delay_us(0, 30'000);
  const int trials = Trials(20);
  for (int trial = 0; trial < trials; ++trial) {
    SCOPED_TRACE(trial);
    store_.reset();
    Empty();
    const pid_t child = fork();
    if (child == 0) {
      const auto store = GetParam().open(folder_, 0);
      for (;;) pause();
    }
    std::this_thread::sleep_for(std::chrono::microseconds(delay_us(random)));
    kill(child, SIGKILL);
    ASSERT_EQ(waitpid(child, nullptr, 0), child);
    ++promise.trials;
    Reopen();
    const bool works = domain_->CreateRig(TestRig("a")).ok();
    EXPECT_TRUE(works);
    if (!works) ++promise.lost;
  }
}

}  // namespace
}  // namespace selfcal::server
