// An import survives kill -9 at any moment: what a client resends and what the
// daemon finds on its disk add up to the same scores, tables and runs.
#include <gmock/gmock.h>
#include <google/protobuf/util/message_differencer.h>

#include <chrono>
#include <iostream>
#include <random>
#include <thread>

#include "client/selfcal/client.h"
#include "test/client/selfcal/drain.h"
#include "test/support/eventually.h"
#include "test/system/running_daemon.h"
#include "test/system/simulated_walk.h"

namespace selfcal::client {
namespace {

using google::protobuf::util::MessageDifferencer;
using std::chrono::milliseconds;

// What an import left behind.
struct Outcome {
  DaemonState state;
  std::vector<v1::Recalibration> runs;  // newest first
  StreamStatistics stream;
  int kills_in_flight = 0;  // while a segment was not acknowledged
};

ClientOptions Options(const std::string& target, const Device& device) {
  ClientOptions options;
  options.target = target;
  options.rig = device.rig.id;
  options.max_queue = static_cast<int>(device.segments.size());
  // The daemon does not live long.
  options.min_backoff = milliseconds(1);
  options.max_backoff = milliseconds(20);
  return options;
}

bool InFlight(const StreamStatistics& statistics) {
  return statistics.queued > statistics.stored + statistics.duplicates;
}

bool IsRunning(DaemonView& view) {
  const auto runs = view.GetRuns();
  return runs.ok() && !runs->empty() &&
         runs->front().state() == v1::Recalibration::RUNNING;
}

// Streams the device while the daemon is killed `kills` times; the segments are
// spread evenly over its lives, the last ones go out just before the last kill.
// Then it is killed `kills_in_run` times while it recalibrates.
Outcome Import(const Device& device,
               int kills,
               std::uint64_t seed,
               int kills_in_run = 0) {
  const ScratchFolder folder;
  auto daemon = folder.StartDaemon();
  DaemonView view(folder.target(), device.rig.id);
  EXPECT_TRUE(view.CreateRig(device.rig).ok());
  SegmentStream stream(Options(folder.target(), device), nullptr);
  Outcome outcome;
  std::mt19937_64 random(seed);
  std::uniform_int_distribution<int> life_ms(5, 150);
  std::uniform_int_distribution<int> after_send_ms(0, 8);
  std::size_t next = 0;
  const auto send_until = [&](std::size_t end) {
    while (next < end) EXPECT_TRUE(stream.Send(device.segments[next++]));
  };
  for (int kill = 1; kill <= kills; ++kill) {
    std::this_thread::sleep_for(milliseconds(life_ms(random)));
    send_until(device.segments.size() * kill / kills);
    std::this_thread::sleep_for(milliseconds(after_send_ms(random)));
    daemon->Kill();
    outcome.kills_in_flight += InFlight(stream.statistics());
    daemon = folder.StartDaemon();
  }
  send_until(device.segments.size());
  EXPECT_TRUE(DrainFully(&stream, 2 * kLongWait).ok());
  for (int kill = 0; kill < kills_in_run; ++kill) {
    EXPECT_TRUE(Eventually(
        [&] { return IsRunning(view); }, 2 * kLongWait, kDaemonInterval));
    daemon->Kill();
    daemon = folder.StartDaemon();
  }
  EXPECT_TRUE(WaitUntilIdle(view, device.segments.size(), 4 * kLongWait).ok());
  outcome.stream = stream.statistics();
  outcome.state = *view.GetState();
  outcome.runs = *view.GetRuns();
  return outcome;
}

std::vector<std::string> Names(const std::vector<v1::Segment>& segments) {
  std::vector<std::string> names;
  for (const v1::Segment& segment : segments) names.push_back(segment.name());
  return names;
}

// Equal but for the time of arrival.
void ExpectSameSegments(std::vector<v1::Segment> a,
                        std::vector<v1::Segment> b) {
  ASSERT_EQ(Names(a), Names(b));
  for (std::size_t i = 0; i < a.size(); ++i) {
    a[i].clear_receive_time();
    b[i].clear_receive_time();
    EXPECT_EQ(a[i].state(), v1::Segment::SCORED) << a[i].problem();
    MessageDifferencer differencer;
    std::string difference;
    differencer.ReportDifferencesToString(&difference);
    EXPECT_TRUE(differencer.Compare(a[i], b[i])) << difference;
  }
}

void ExpectSameTables(const std::vector<v1::Table>& a,
                      const std::vector<v1::Table>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_TRUE(MessageDifferencer::Equals(a[i], b[i]))
        << a[i].ShortDebugString() << "\n"
        << b[i].ShortDebugString();
  }
}

void PrintFigures(const Outcome& outcome, int kills) {
  std::cout << kills << " kills, " << outcome.kills_in_flight
            << " with segments in flight; connections "
            << outcome.stream.connections << ", resent "
            << outcome.stream.resent << ", duplicates "
            << outcome.stream.duplicates << "\n";
}

TEST(KillImport, TwentyKillsChangeNeitherScoresNorTables) {
  constexpr int kKills = 20;
  Device device = SimulateWalk("walker", 60, 11);
  device.rig.table_size = 100;  // never full: no run starts
  const Outcome calm = Import(device, 0, 0);
  const Outcome killed = Import(device, kKills, 5);
  PrintFigures(killed, kKills);

  // The kills fell into the import.
  EXPECT_GE(killed.kills_in_flight, 1);
  EXPECT_GE(killed.stream.resent, 1u);
  EXPECT_EQ(killed.stream.dropped, 0u);
  EXPECT_EQ(killed.stream.rejected, 0u);
  ASSERT_EQ(calm.state.segments.size(), device.segments.size());
  ExpectSameSegments(calm.state.segments, killed.state.segments);
  ExpectSameTables(calm.state.tables, killed.state.tables);
  EXPECT_TRUE(calm.runs.empty());
  EXPECT_TRUE(killed.runs.empty());
}

const v1::Calibration& Newest(const Outcome& outcome) {
  return outcome.state.calibrations.back();
}

int CountActive(const Outcome& outcome) {
  int count = 0;
  for (const v1::Calibration& calibration : outcome.state.calibrations) {
    count += calibration.state() == v1::Calibration::ACTIVE;
  }
  return count;
}

// A run that was under way when the daemon was killed starts again on the
// segments that the tables held when it was triggered.
TEST(KillImport, KillsDuringRecalibrationLeaveOneRunOfTheSameSegments) {
  constexpr int kKills = 5;
  constexpr int kKillsInRun = 1;
  Device device = SimulateWalk("walker", 12, 3);
  device.rig.table_size = 12;  // full with the last segment
  device.rig.min_gain_nats = 0;
  const Outcome calm = Import(device, 0, 0);
  const Outcome killed = Import(device, kKills, 7, kKillsInRun);
  PrintFigures(killed, kKills);

  for (const Outcome* outcome : {&calm, &killed}) {
    ASSERT_EQ(outcome->runs.size(), 1u);
    EXPECT_EQ(outcome->runs[0].state(), v1::Recalibration::SUCCEEDED);
    ASSERT_EQ(outcome->state.calibrations.size(), 2u);
    EXPECT_EQ(CountActive(*outcome), 1);
    EXPECT_EQ(Newest(*outcome).state(), v1::Calibration::ACTIVE)
        << Newest(*outcome).ShortDebugString();
  }
  EXPECT_GT(killed.runs[0].attempts(), calm.runs[0].attempts());
  EXPECT_THAT(killed.runs[0].segments(),
              ::testing::ElementsAreArray(calm.runs[0].segments()));
  EXPECT_TRUE(MessageDifferencer::Equals(Newest(calm).parameters(),
                                         Newest(killed).parameters()));
  ExpectSameSegments(calm.state.segments, killed.state.segments);
  ExpectSameTables(calm.state.tables, killed.state.tables);
}

}  // namespace
}  // namespace selfcal::client
