// Clean data gives no finding: over seeds, motions, rigs, and calibrations as
// inaccurate as a factory calibration. SELFCAL_TRIALS sets the number of seeds.
#include <gtest/gtest.h>

#include <iostream>
#include <memory>

#include "core/simulation/simulate.h"
#include "test/core/preflight/mistakes.h"
#include "test/core/simulation/rigs.h"
#include "test/promise.h"

namespace selfcal {
namespace {

struct Case {
  const char* name;
  Rig rig;
  // The calibration that is stated: of the SLAM system, or the true one.
  bool stated_true;
  double time_offset_s;  // true, known to the SLAM system and stated
};

struct Motion {
  const char* name;
  std::unique_ptr<Trajectory> (*make)(std::uint64_t seed);
};

constexpr double kSeconds = 12;

const Motion kMotions[] = {
    {"vigorous",
     [](std::uint64_t seed) { return MakeHandheld(kSeconds, 1, seed); }},
    {"moderate",
     [](std::uint64_t seed) { return MakeHandheld(kSeconds, 0.3, seed); }},
    {"calm",
     [](std::uint64_t seed) { return MakeHandheld(kSeconds, 0.1, seed); }},
    {"mixed", [](std::uint64_t seed) { return MakeMixed(kSeconds, seed); }},
    {"rest", [](std::uint64_t) { return MakeRest(kSeconds); }}};

Diagnosis DiagnoseClean(const Case& one, const Motion& motion, int seed) {
  Rig rig = one.rig;
  for (CameraCalibration& camera : rig.factory.cameras) {
    camera.time_offset_s = one.time_offset_s;
  }
  SimulationOptions options;
  options.seed = seed;
  options.outlier_fraction = 0.02;
  options.landmarks_in_view = 60;
  const Calibration slam = PerturbCalibration(rig.factory, {}, seed);
  const auto session =
      Simulate(rig, rig.factory, slam, *motion.make(seed), "session", options);
  return Diagnose(rig, one.stated_true ? rig.factory : slam, session.segments);
}

TEST(CleanData, GivesNoFinding) {
  const int seeds = Trials(10);
  const Case cases[] = {
      {"hand-held", HandheldRig("a"), false, 0},
      {"hand-held, offset of 15 ms", HandheldRig("a"), false, 0.015},
      {"hand-held, offset of 100 ms", HandheldRig("a"), false, 0.1},
      {"hand-held, true calibration stated", HandheldRig("a"), true, 0},
      {"stereo", StereoRig(), false, 0},
      {"four cameras", RigOfCameras(4), false, 0}};
  int sessions = 0, alarms = 0;
  for (const Case& one : cases) {
    for (const Motion& motion : kMotions) {
      for (int seed = 1; seed <= seeds; ++seed) {
        const Diagnosis diagnosis = DiagnoseClean(one, motion, seed);
        ++sessions;
        alarms += !diagnosis.findings.empty();
        EXPECT_TRUE(diagnosis.findings.empty())
            << one.name << ", " << motion.name << ", seed " << seed << "\n"
            << Text(diagnosis);
      }
    }
  }
  std::cout << alarms << " false alarms in " << sessions << " sessions\n";
}

}  // namespace
}  // namespace selfcal
