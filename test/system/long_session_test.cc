// An hour of a session, 36,000 keyframes, goes through the builder, the stream,
// the daemon and the score at constant memory.
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <fstream>
#include <iostream>
#include <set>
#include <string>
#include <vector>

#include "client/selfcal/client.h"
#include "client/selfcal/segment_builder.h"
#include "core/simulation/simulate.h"
#include "test/client/selfcal/drain.h"
#include "test/support/eventually.h"
#include "test/system/looped_session.h"
#include "test/system/running_daemon.h"

namespace selfcal::client {
namespace {

constexpr int kKeyframes = 36'000;
constexpr int kSegmentKeyframes = 40;
constexpr int kSegments = kKeyframes / kSegmentKeyframes;
constexpr int kSegmentsBetweenSamples = 30;
// Of the whole hour after the first minutes: 10 KiB for each segment.
constexpr double kMaxGrowth_MiB = 8;

// Sanitizers keep freed memory for a while.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool kOwnAllocator = false;
#else
constexpr bool kOwnAllocator = true;
#endif

// Resident memory of a process [MiB].
double ResidentMebibytes(pid_t pid) {
  std::ifstream status("/proc/" + std::to_string(pid) + "/status");
  std::string word;
  while (status >> word) {
    double kibibytes = 0;
    if (word == "VmRSS:" && status >> kibibytes) return kibibytes / 1024;
  }
  ADD_FAILURE() << "no memory of process " << pid;
  return 0;
}

// Memory over the run.
class MemoryLog {
 public:
  explicit MemoryLog(pid_t pid) : pid_(pid) {}

  void Sample() { samples_.push_back(ResidentMebibytes(pid_)); }

  // All but the first tenth of the samples against that tenth.
  void ExpectConstant(const std::string& name) const {
    const auto warm =
        samples_.begin() + static_cast<std::ptrdiff_t>(samples_.size()) / 10;
    const double before = *std::max_element(samples_.begin(), warm);
    const double after = *std::max_element(warm, samples_.end());
    std::cout << name << ": " << before << " MiB after the warm-up, up to "
              << after << " MiB later\n";
    if (kOwnAllocator) {
      EXPECT_LT(after, before + kMaxGrowth_MiB) << name;
    }
  }

 private:
  const pid_t pid_;
  std::vector<double> samples_;
};

// Asks for little: a list of all segments would itself take memory.
int CountScored(DaemonView& view) {
  const auto tables = view.GetTables();
  return tables.ok() && !tables->empty()
             ? static_cast<int>(tables->front().scored())
             : 0;
}

TEST(LongSession, AnHourGoesThroughAtConstantMemory) {
  Rig rig = HandheldRig("marathon");
  const Calibration truth = rig.factory;
  rig.factory = PerturbCalibration(truth, {}, 1);
  rig.min_gain_nats = 1e9;  // of no segment: tables stay empty, no run starts
  const ScratchFolder folder;
  const auto daemon = folder.StartDaemon();
  DaemonView view(folder.target(), rig.id);
  ASSERT_TRUE(view.CreateRig(rig).ok());
  ClientOptions options;
  options.target = folder.target();
  options.rig = rig.id;
  SegmentStream stream(options, nullptr);
  const auto wait_for_room = [&] {
    return Eventually([&] {
      const StreamStatistics s = stream.statistics();
      return s.queued <
             s.stored + static_cast<std::uint64_t>(options.max_queue);
    });
  };

  LoopedSession session(rig, truth);
  SegmentBuilder builder({.session = "hour", .keyframes = kSegmentKeyframes});
  MemoryLog client_memory(getpid());
  MemoryLog daemon_memory(daemon->pid());
  int sent = 0;
  const auto send_complete = [&] {
    while (auto segment = builder.Take()) {
      ASSERT_TRUE(wait_for_room());
      ASSERT_TRUE(stream.Send(*std::move(segment)));
      if (++sent % kSegmentsBetweenSamples == 0) {
        client_memory.Sample();
        daemon_memory.Sample();
      }
    }
  };
  for (int k = 0; k < kKeyframes; ++k) {
    session.Feed(k, &builder);
    ASSERT_NO_FATAL_FAILURE(send_complete());
  }
  builder.Flush(kSegmentKeyframes);
  ASSERT_NO_FATAL_FAILURE(send_complete());
  ASSERT_EQ(sent, kSegments);
  ASSERT_TRUE(DrainFully(&stream).ok());

  ASSERT_TRUE(Eventually([&] { return CountScored(view) == kSegments; },
                         2 * kLongWait,
                         kDaemonInterval));
  daemon_memory.Sample();
  client_memory.ExpectConstant("client");
  daemon_memory.ExpectConstant("daemon");

  const StreamStatistics statistics = stream.statistics();
  EXPECT_EQ(statistics.stored, static_cast<std::uint64_t>(kSegments));
  EXPECT_EQ(statistics.dropped + statistics.rejected, 0u);
  const auto state = view.GetState();
  ASSERT_TRUE(state.ok());
  std::set<std::string> names;
  for (const v1::Segment& segment : state->segments) {
    EXPECT_EQ(segment.state(), v1::Segment::SCORED) << segment.problem();
    EXPECT_EQ(segment.keyframes(), kSegmentKeyframes);
    names.insert(segment.name());
  }
  EXPECT_EQ(names.size(), static_cast<std::size_t>(kSegments));
}

}  // namespace
}  // namespace selfcal::client
