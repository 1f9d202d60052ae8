// A real recording through a real daemon.
#include <gtest/gtest.h>

#include <algorithm>
#include <iostream>
#include <limits>

#include "client/demo/device.h"
#include "client/selfcal/client.h"
#include "test/client/selfcal/drain.h"
#include "test/recordings.h"
#include "test/system/running_daemon.h"

namespace selfcal::client {
namespace {

constexpr std::chrono::seconds kLimit{600};

// Streams all segments and waits until nothing is left to do.
DaemonState ImportedState(const Device& device, const ScratchFolder& folder) {
  const auto daemon = folder.StartDaemon();
  DaemonView view(folder.target(), device.rig.id);
  EXPECT_TRUE(view.CreateRig(device.rig).ok());
  ClientOptions options;
  options.target = folder.target();
  options.rig = device.rig.id;
  options.max_queue = static_cast<int>(device.segments.size());
  SegmentStream stream(options, nullptr);
  for (const MotionSegment& segment : device.segments) {
    EXPECT_TRUE(stream.Send(segment));
  }
  EXPECT_TRUE(DrainFully(&stream).ok());
  EXPECT_TRUE(WaitUntilIdle(view, device.segments.size(), kLimit).ok());
  return view.GetState().value_or(DaemonState());
}

// Entropy of the first segment above the highest of the others [nat].
double EntropyLead(const std::vector<v1::Segment>& segments,
                   const std::string& group) {
  double highest = -std::numeric_limits<double>::infinity();
  for (std::size_t i = 1; i < segments.size(); ++i) {
    highest = std::max(highest, FindScore(segments[i], group)->entropy_nats());
  }
  return FindScore(segments[0], group)->entropy_nats() - highest;
}

// The recording begins with the device at rest.
TEST(TangoThroughTheDaemon, RestIsThePoorestAndTheTablesBringACalibration) {
  SELFCAL_NEED_RECORDING(path, "tango_handheld");
  const auto device = ReadDevice({path}, {40, 5e-5, 2e-3});
  ASSERT_TRUE(device.ok()) << device.status();
  ASSERT_EQ(device->segments.size(), 14u);
  ASSERT_EQ(device->rig.table_size, 8);
  const ScratchFolder folder;
  const DaemonState state = ImportedState(*device, folder);

  ASSERT_EQ(state.segments.size(), 14u);
  for (const v1::Segment& segment : state.segments) {
    ASSERT_EQ(segment.state(), v1::Segment::SCORED) << segment.problem();
    ASSERT_EQ(segment.scores_size(), 3);
  }
  for (const v1::Table& table : state.tables) {
    const std::string group = LastPart(table.name());
    const double lead = EntropyLead(state.segments, group);
    std::cout << group << ": segment 0 is " << lead << " nats above the next\n";
    EXPECT_GE(lead, 1) << group;
    EXPECT_EQ(table.entries_size(), 8) << group;
  }
  std::int64_t active = 0;
  for (const v1::Calibration& calibration : state.calibrations) {
    std::cout << "version " << calibration.version() << ": "
              << v1::Calibration::State_Name(calibration.state()) << ", "
              << calibration.provenance().segments_size() << " segments, "
              << calibration.solver().status() << " after "
              << calibration.solver().iterations() << " iterations\n";
    for (const std::string& reason : calibration.reasons()) {
      std::cout << "  " << reason << "\n";
    }
    if (calibration.state() == v1::Calibration::ACTIVE) {
      active = calibration.version();
    }
  }
  EXPECT_GE(active, 2);
}

}  // namespace
}  // namespace selfcal::client
