// Clean data gives no finding: over seeds, motions, rigs, lenses of each model,
// and calibrations as inaccurate as a factory calibration. SELFCAL_TRIALS sets
// the number of seeds.
#include <gtest/gtest.h>

#include <iostream>
#include <memory>
#include <string>
#include <vector>

#include "core/model/camera_model.h"
#include "core/simulation/simulate.h"
#include "test/core/preflight/mistakes.h"
#include "test/core/simulation/rigs.h"
#include "test/promise.h"

namespace selfcal {
namespace {

struct Case {
  std::string name;
  Rig rig;
  // The calibration that is stated: of the SLAM system, or the true one.
  bool stated_true;
  double time_offset_s;  // true, known to the SLAM system and stated
  int seeds;
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

// There are more models than other cases: each has one seed.
std::vector<Case> CleanCases() {
  const int seeds = Trials(10);
  std::vector<Case> cases = {
      {"hand-held", HandheldRig("a"), false, 0, seeds},
      {"hand-held, offset of 15 ms", HandheldRig("a"), false, 0.015, seeds},
      {"hand-held, offset of 100 ms", HandheldRig("a"), false, 0.1, seeds},
      {"hand-held, true calibration stated", HandheldRig("a"), true, 0, seeds},
      {"stereo", StereoRig(), false, 0, seeds},
      {"four cameras", RigOfCameras(4), false, 0, seeds}};
  for (const DistortionModel model : DistortionModels()) {
    cases.push_back({"lens " + std::string(DistortionName(model)),
                     LensRig(model),
                     false,
                     0,
                     Trials(1)});
  }
  return cases;
}

TEST(CleanData, GivesNoFinding) {
  int sessions = 0, alarms = 0;
  for (const Case& one : CleanCases()) {
    for (const Motion& motion : kMotions) {
      for (int seed = 1; seed <= one.seeds; ++seed) {
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
