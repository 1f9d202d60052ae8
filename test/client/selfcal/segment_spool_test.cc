// A stream with a spool: the daemon is away for longer than memory has room.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <fstream>
#include <mutex>
#include <random>
#include <thread>
#include <vector>

#include "client/selfcal/client.h"
#include "test/client/selfcal/drain.h"
#include "test/client/selfcal/fake_daemon.h"
#include "test/client/selfcal/test_segments.h"
#include "test/promise.h"
#include "test/support/eventually.h"
#include "test/support/temp_folder.h"

namespace selfcal::client {
namespace {

class SegmentSpoolTest : public ::testing::Test {
 protected:
  ClientOptions Options() const {
    ClientOptions options;
    options.target = daemon_.target();
    options.rig = "device";
    options.max_queue = 4;
    options.spool_dir = folder_.path();
    options.min_backoff = std::chrono::milliseconds(1);
    options.max_backoff = std::chrono::milliseconds(20);
    return options;
  }
  SegmentStream::AckCallback Callback() {
    return [this](const Acknowledgement& ack) {
      std::lock_guard lock(mutex_);
      acks_.push_back(ack.key);
    };
  }
  std::vector<SegmentKey> acks() const {
    std::lock_guard lock(mutex_);
    return acks_;
  }
  // As a device does: never faster than the disk.
  void Send(SegmentStream* stream, std::int64_t begin, std::int64_t end) {
    for (std::int64_t i = begin; i < end; ++i) {
      const std::uint64_t before = stream->statistics().dropped;
      ASSERT_TRUE(Eventually([&] { return stream->Send(Segment(i)); }));
      refused_ += stream->statistics().dropped - before;
    }
  }
  std::vector<std::filesystem::path> Files(const std::string& extension) const {
    std::vector<std::filesystem::path> files;
    for (const auto& file :
         std::filesystem::directory_iterator(folder_.path() / "device")) {
      if (file.path().extension() == extension) files.push_back(file.path());
    }
    std::sort(files.begin(), files.end());
    return files;
  }

  TempFolder folder_;
  FakeDaemon daemon_;
  std::uint64_t refused_ = 0;

 private:
  mutable std::mutex mutex_;
  std::vector<SegmentKey> acks_;
};

TEST_F(SegmentSpoolTest, HoldsOnDiskWhatMemoryHasNoRoomFor) {
  SegmentStream stream(Options(), Callback());
  Send(&stream, 0, 50);
  ASSERT_TRUE(Eventually([&] { return stream.statistics().spooled >= 48; }));
  EXPECT_EQ(stream.statistics().spool_segments, 48u);
  EXPECT_GT(stream.statistics().spool_bytes, 48u * 5000);
  EXPECT_EQ(Files(".segment").size(), 48u);
  EXPECT_TRUE(stream.spool_status().ok());

  daemon_.Start();
  ASSERT_TRUE(DrainFully(&stream).ok());
  EXPECT_EQ(acks(), Keys(0, 50)) << "each once, and in order";
  EXPECT_EQ(stream.statistics().stored, 50u);
  EXPECT_EQ(stream.statistics().spool_segments, 0u);
  EXPECT_EQ(stream.statistics().spool_bytes, 0u);
  EXPECT_TRUE(Files(".segment").empty());
}

TEST_F(SegmentSpoolTest, KeepsTheOrderWhileTheDaemonComesAndGoes) {
  SegmentStream stream(Options(), Callback());
  for (int i = 0; i < 6; ++i) {
    Send(&stream, 20 * i, 20 * i + 10);
    daemon_.Start();
    Send(&stream, 20 * i + 10, 20 * i + 20);
    ASSERT_TRUE(daemon_.WaitForRequests(static_cast<std::size_t>(20 * i + 1)));
    daemon_.Stop();
  }
  daemon_.Start();
  ASSERT_TRUE(DrainFully(&stream).ok());
  EXPECT_EQ(acks(), Keys(0, 120));
  EXPECT_GT(stream.statistics().spooled, 0u);
}

TEST_F(SegmentSpoolTest, GivesAllToTheNextProcess) {
  {
    SegmentStream stream(Options(), Callback());
    Send(&stream, 0, 20);
  }
  EXPECT_EQ(Files(".segment").size(), 20u) << "those in memory, too";
  {
    SegmentStream stream(Options(), Callback());
    Send(&stream, 20, 25);
  }
  daemon_.Start();
  SegmentStream stream(Options(), Callback());
  Send(&stream, 25, 30);
  ASSERT_TRUE(DrainFully(&stream).ok());
  EXPECT_EQ(acks(), Keys(0, 30));
  EXPECT_EQ(stream.statistics().spool_recovered, 25u);
  EXPECT_EQ(stream.statistics().stored, 30u);
}

TEST_F(SegmentSpoolTest, DropsTheNewestWhenItIsFull) {
  ClientOptions options = Options();
  options.max_spool_bytes = 60'000;
  SegmentStream stream(options, Callback());
  std::int64_t taken = 0;
  std::uint64_t refused = 0;
  // Until memory is full behind a spool that is full.
  ASSERT_TRUE(Eventually([&] {
    if (stream.Send(Segment(taken))) {
      ++taken;
      return false;
    }
    ++refused;
    return absl::IsResourceExhausted(stream.spool_status());
  }));
  for (int i = 0; i < 20; ++i, ++refused) {
    EXPECT_FALSE(stream.Send(Segment(taken)));
  }
  const StreamStatistics full = stream.statistics();
  EXPECT_EQ(full.spool_segments + 4, static_cast<std::uint64_t>(taken));
  EXPECT_LE(full.spool_bytes, 60'000u);
  const std::uint64_t one = full.spool_bytes / full.spool_segments;
  EXPECT_GT(full.spool_bytes + one + 1, 60'000u)
      << "one more would have fitted";
  EXPECT_EQ(full.dropped, refused);
  EXPECT_EQ(full.queued, static_cast<std::uint64_t>(taken));

  daemon_.Start();
  ASSERT_TRUE(DrainFully(&stream).ok());
  EXPECT_EQ(acks(), Keys(0, taken)) << "what was taken is not lost";
  EXPECT_TRUE(stream.Send(Segment(taken)));
}

TEST_F(SegmentSpoolTest, SetsDamagedFilesAsideAndGoesOn) {
  {  // The first two are of this process's memory, all are on disk at its end.
    SegmentStream stream(Options(), Callback());
    Send(&stream, 0, 10);
  }
  const auto files = Files(".segment");
  ASSERT_EQ(files.size(), 10u);
  std::filesystem::resize_file(files[3], 100);
  std::fstream flip(files[6], std::ios::in | std::ios::out);
  flip.seekp(2000);
  flip.put('!');
  flip.close();
  daemon_.Start();
  SegmentStream stream(Options(), Callback());
  ASSERT_TRUE(DrainFully(&stream).ok());
  auto expected = Keys(0, 10);
  expected.erase(expected.begin() + 6);
  expected.erase(expected.begin() + 3);
  EXPECT_EQ(acks(), expected);
  EXPECT_EQ(stream.statistics().spool_damaged, 2u);
  EXPECT_EQ(Files(".damaged").size(), 2u);
  EXPECT_TRUE(Files(".segment").empty());
}

TEST_F(SegmentSpoolTest, WorksWithoutTheSpoolWhenItCannotBeUsed) {
  SegmentStream holder(Options(), nullptr);
  ASSERT_TRUE(DrainFully(&holder).ok());  // it has the spool now
  daemon_.Start();
  SegmentStream stream(Options(), Callback());
  Send(&stream, 0, 20);
  ASSERT_TRUE(DrainFully(&stream).ok());
  EXPECT_EQ(acks(), Keys(0, 20));
  EXPECT_TRUE(absl::IsAlreadyExists(stream.spool_status()));
  EXPECT_EQ(stream.statistics().spool_failures, 1u);
}

// A process that feeds a stream without a daemon (spool_feeder.cc), killed at a
// random moment. What it saw spooled must be sent by the next one, in order.
struct Fed {
  std::int64_t spooled = 0;  // segments 1 to this one were on disk
};

Fed FeedAndKill(const ClientOptions& options, int after_us) {
  int ends[2];
  EXPECT_EQ(pipe2(ends, O_CLOEXEC), 0);
  const pid_t feeder = fork();
  if (feeder == 0) {
    dup2(ends[1], STDOUT_FILENO);
    execl(SELFCAL_SPOOL_FEEDER,
          SELFCAL_SPOOL_FEEDER,
          options.target.c_str(),
          options.spool_dir.c_str(),
          nullptr);
    _exit(127);
  }
  close(ends[1]);
  FILE* out = fdopen(ends[0], "r");
  Fed fed;
  long long number = 0;
  // Starts to count when the first is on disk.
  if (std::fscanf(out, "%lld", &number) == 1) fed.spooled = number;
  usleep(static_cast<useconds_t>(after_us));
  kill(feeder, SIGKILL);
  while (std::fscanf(out, "%lld", &number) == 1) fed.spooled = number;
  std::fclose(out);
  int status = 0;
  waitpid(feeder, &status, 0);
  EXPECT_TRUE(WIFSIGNALED(status)) << "the feeder ended by itself";
  return fed;
}

TEST_F(SegmentSpoolTest, SpooledSegmentsSurviveAKillAtAnyInstant) {
  Promise promise("what the client spools survives a kill");
  const int trials = Trials(10);
  std::mt19937 random(1);
  for (; promise.trials < trials; ++promise.trials) {
    std::filesystem::remove_all(folder_.path() / "device");
    const Fed fed = FeedAndKill(Options(), static_cast<int>(random() % 20'000));
    ASSERT_GT(fed.spooled, 0);
    FakeDaemon daemon;
    daemon.Start();
    ClientOptions options = Options();
    options.target = daemon.target();
    SegmentStream stream(options, nullptr);
    ASSERT_TRUE(DrainFully(&stream).ok());
    const auto stored = daemon.stored();
    for (std::int64_t i = 1; i <= fed.spooled; ++i) {
      if (stored.count({"walk", i}) == 0) ++promise.lost;
    }
    const auto connections = daemon.connections();
    ASSERT_EQ(connections.size(), 1u);
    EXPECT_TRUE(std::is_sorted(connections[0].begin(), connections[0].end()));
    EXPECT_EQ(stream.statistics().spool_damaged, 0u);
  }
}

}  // namespace
}  // namespace selfcal::client
