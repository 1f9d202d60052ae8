// A calibration stays within its memory limit, whatever a SLAM system
// recognises again: measured like the limit of the worker.
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <new>
#include <utility>
#include <vector>

#include "core/calibration/calibrate.h"
#include "core/simulation/simulate.h"
#include "test/core/simulation/rigs.h"

namespace selfcal {
namespace {

constexpr rlim_t kMiB = 1 << 20;

struct MapOptions {
  int segments = 24;
  int every = 2;  // of so many segments of the session, one is used
  int landmarks_in_view = 120;
  double revisit_fraction = 0.9;
};

std::vector<MotionSegment> MapSession(const Rig& rig,
                                      const MapOptions& options) {
  SimulationOptions simulation;
  simulation.landmarks_in_view = options.landmarks_in_view;
  simulation.revisit_fraction = options.revisit_fraction;
  const int count = (options.segments - 1) * options.every + 1;
  const double duration_s = (count * simulation.keyframes_per_segment + 5) /
                            simulation.keyframe_rate_hz;
  std::vector<MotionSegment> all =
      SimulateHandheld(rig, duration_s, simulation).segments;
  std::vector<MotionSegment> used;
  for (int s = 0; s < count; s += options.every) {
    used.push_back(std::move(all.at(s)));
  }
  return used;
}

// Bytes of data that the process has mapped.
rlim_t DataBytes() {
  std::ifstream file("/proc/self/statm");
  rlim_t pages = 0;
  for (int column = 0; column < 6; ++column) file >> pages;
  return pages * sysconf(_SC_PAGESIZE);
}

enum Outcome { kConverged, kNotConverged, kOutOfMemory };

// Calibrates in a process with this limit of additional memory.
Outcome CalibrateWithin(rlim_t bytes,
                        const Rig& rig,
                        const std::vector<MotionSegment>& segments) {
  const pid_t child = fork();
  if (child == 0) {
    const rlim_t most = DataBytes() + bytes;
    const rlimit limit{.rlim_cur = most, .rlim_max = most};
    if (setrlimit(RLIMIT_DATA, &limit) != 0) std::_Exit(EXIT_FAILURE + 100);
    Outcome outcome = kNotConverged;
    try {
      Calibration start = PerturbCalibration(rig.factory, {}, 1);
      Rig wrong = rig;
      wrong.factory = start;
      const CalibrationResult result = Calibrate(wrong, start, segments);
      if (result.status == CalibrateStatus::kConverged) outcome = kConverged;
    } catch (const std::bad_alloc&) {
      outcome = kOutOfMemory;
    }
    std::_Exit(outcome);
  }
  int status = 0;
  EXPECT_EQ(waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFEXITED(status));
  return static_cast<Outcome>(WEXITSTATUS(status));
}

class CalibrationMemory : public testing::Test {
 protected:
  void SetUp() override {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    GTEST_SKIP() << "sanitizers take memory of their own";
#endif
  }
};

TEST_F(CalibrationMemory, TheLimitIsOne) {
  const Rig rig = HandheldRig("r");
  EXPECT_EQ(CalibrateWithin(8 * kMiB, rig, MapSession(rig, {.segments = 4})),
            kOutOfMemory);
}

TEST_F(CalibrationMemory, OfAMapThatPersists) {
  const Rig rig = HandheldRig("r");
  EXPECT_EQ(CalibrateWithin(256 * kMiB, rig, MapSession(rig, {})), kConverged);
}

TEST_F(CalibrationMemory, OfAMapThatPersistsInOneChain) {
  const Rig rig = HandheldRig("r");
  EXPECT_EQ(CalibrateWithin(256 * kMiB, rig, MapSession(rig, {.every = 1})),
            kConverged);
}

TEST_F(CalibrationMemory, OfTwoCamerasThatSeeMuch) {
  const Rig rig = StereoRig();
  EXPECT_EQ(CalibrateWithin(256 * kMiB,
                            rig,
                            MapSession(rig,
                                       {.segments = 16,
                                        .landmarks_in_view = 250,
                                        .revisit_fraction = 0.1})),
            kConverged);
}

TEST_F(CalibrationMemory, OfTwoCamerasThatSeeMuchInOneChain) {
  const Rig rig = StereoRig();
  EXPECT_EQ(CalibrateWithin(256 * kMiB,
                            rig,
                            MapSession(rig,
                                       {.segments = 16,
                                        .every = 1,
                                        .landmarks_in_view = 250,
                                        .revisit_fraction = 0.1})),
            kConverged);
}

}  // namespace
}  // namespace selfcal
