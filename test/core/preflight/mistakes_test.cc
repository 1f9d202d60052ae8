// Each of the usual mistakes, planted in simulated data, is found and named,
// and nothing else is.
#include "test/core/preflight/mistakes.h"

#include <algorithm>
#include <cstdint>
#include <functional>
#include <iostream>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "core/model/camera_model.h"
#include "core/simulation/simulate.h"
#include "test/core/preflight/expect_found.h"
#include "test/core/simulation/rigs.h"
#include "test/promise.h"

namespace selfcal {
namespace {

FedData Simulated(const Rig& rig, const Trajectory& trajectory, int seed) {
  SimulationOptions options;
  options.seed = seed;
  FedData data;
  data.rig = rig;
  data.rig.factory = PerturbCalibration(rig.factory, {}, seed);
  data.segments =
      Simulate(
          rig, rig.factory, data.rig.factory, trajectory, "session", options)
          .segments;
  return data;
}

// Tests over seeds; SELFCAL_TRIALS sets their number.
void ExpectAllFound(
    const std::function<std::unique_ptr<Trajectory>(int)>& motion,
    const Rig& rig = HandheldRig("rig")) {
  int planted = 0, named = 0;
  for (int seed = 1; seed <= Trials(1); ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const FedData clean = Simulated(rig, *motion(seed), seed);
    const Diagnosis diagnosis = clean.Diagnose();
    ASSERT_TRUE(diagnosis.findings.empty()) << Text(diagnosis);
    for (const Mistake& mistake : Mistakes()) {
      ++planted;
      named += ExpectFound(mistake, clean);
    }
  }
  std::cout << planted << " mistakes planted, " << named << " named\n";
}

TEST(Mistakes, AreFoundInVigorousMotion) {
  ExpectAllFound([](int seed) { return MakeHandheld(40, 1, seed); });
}

TEST(Mistakes, AreFoundInCalmMotion) {
  ExpectAllFound([](int seed) { return MakeHandheld(40, 0.2, seed); });
}

TEST(Mistakes, AreFoundInMixedMotion) {
  ExpectAllFound([](int seed) { return MakeMixed(60, seed); });
}

// The four cameras look in three directions.
TEST(Mistakes, AreFoundWithFourCameras) {
  ExpectAllFound([](int seed) { return MakeMixed(60, seed); }, RigOfCameras(4));
}

// Observations at more than 90 degrees from the axis of the first camera.
int CountBehindCamera(const FedData& data) {
  const CameraCalibration& camera = data.rig.factory.cameras[0];
  int count = 0;
  for (const MotionSegment& segment : data.segments) {
    for (const Observation& o : segment.observations) {
      const KeyframeState& state = segment.keyframes[o.keyframe];
      const Eigen::Vector3d p_I =
          state.q_GI.conjugate() *
          (segment.landmarks[o.landmark].p_G - state.p_GI);
      count += (camera.q_CI * p_I + camera.p_CI).z() < 0;
    }
  }
  return count;
}

// One mistake about the camera, and one about its clock.
TEST(Mistakes, AreFoundWithLensesThatSeeBeyond90Degrees) {
  const std::set<std::string> some = {"rotation_inverted", "images_30ms_late"};
  int lenses = 0;
  for (const DistortionModel model : DistortionModels()) {
    const Rig rig = LensRig(model);
    Eigen::Vector2d z_px;
    if (!Project(rig.factory.cameras[0], {1, 0, -0.1}, &z_px, nullptr)) {
      continue;
    }
    ++lenses;
    SCOPED_TRACE(DistortionName(model));
    const FedData clean = Simulated(rig, *MakeMixed(60, 1), 1);
    EXPECT_GT(CountBehindCamera(clean), 0);
    const Diagnosis diagnosis = clean.Diagnose();
    EXPECT_TRUE(diagnosis.findings.empty()) << Text(diagnosis);
    std::size_t planted = 0;
    for (const Mistake& mistake : Mistakes()) {
      if (!some.contains(mistake.name)) continue;
      ++planted;
      EXPECT_TRUE(ExpectFound(mistake, clean));
    }
    EXPECT_EQ(planted, some.size());
  }
  EXPECT_GE(lenses, 4);
}

// A front end that keeps all landmarks in its first camera.
TEST(Mistakes, LandmarksInTheFirstOfFourCamerasAreFound) {
  const FedData clean = Simulated(RigOfCameras(4), *MakeMixed(60, 1), 1);
  const auto plant = [](FedData* data) {
    const CameraCalibration& camera = data->rig.factory.cameras[0];
    for (MotionSegment& segment : data->segments) {
      std::vector<int> first(segment.landmarks.size(), -1);
      for (const Observation& o : segment.observations) {
        int& keyframe = first[o.landmark];
        if (keyframe < 0 || o.keyframe < keyframe) keyframe = o.keyframe;
      }
      for (std::size_t i = 0; i < first.size(); ++i) {
        if (first[i] < 0) continue;
        const KeyframeState& state = segment.keyframes[first[i]];
        Eigen::Vector3d& p = segment.landmarks[i].p_G;
        p = camera.q_CI * (state.q_GI.conjugate() * (p - state.p_GI)) +
            camera.p_CI;
      }
    }
  };
  EXPECT_TRUE(ExpectFound({"landmarks_in_cam0",
                           {FindingKind::kLandmarkFrame},
                           "cam0, cam1, cam2, cam3: landmarks are in the "
                           "camera frame (of cam0)",
                           "landmarks in G",
                           plant},
                          clean));
}

// A SLAM system that believes in a global shutter: its states are those of the
// middle row, and its landmarks and poses absorb a part of the effect.
TEST(Mistakes, ARollingShutterIsFoundWhereTheSlamSystemIgnoresIt) {
  for (const double readout_s : {0.010, 0.020, 0.033}) {
    for (const double excitation : {0.3, 1.0}) {
      const Rig rig = HandheldRig("rig");
      Calibration truth = rig.factory;
      CameraCalibration& camera = truth.cameras[0];
      camera.line_delay_s = readout_s / camera.height_px;
      SimulationOptions options;
      const auto session = Simulate(rig,
                                    truth,
                                    PerturbCalibration(rig.factory, {}, 1),
                                    *MakeHandheld(40, excitation, 3),
                                    "session",
                                    options);
      const Diagnosis diagnosis = Diagnose(rig, rig.factory, session.segments);
      const auto found =
          std::find_if(diagnosis.findings.begin(),
                       diagnosis.findings.end(),
                       [](const Finding& one) {
                         return one.kind == FindingKind::kRollingShutter;
                       });
      ASSERT_NE(found, diagnosis.findings.end()) << Text(diagnosis);
      std::cout << "readout " << 1e3 * readout_s << " ms, found "
                << 1e3 * found->value << " ms\n";
      EXPECT_NEAR(found->value, readout_s, 0.3 * readout_s);
      // Stated, nothing is left to be found.
      const Diagnosis stated = Diagnose(rig, truth, session.segments);
      EXPECT_TRUE(stated.findings.empty()) << Text(stated);
    }
  }
}

// A SLAM system with a constant offset: its states are later and later. Clean
// data over the same time has no finding, nor one whose drift is stated.
TEST(Mistakes, ClocksThatDriftAreFoundWhereTheSlamSystemIgnoresIt) {
  const Rig rig = HandheldRig("rig");
  for (const double drift : {-1e-4, 3e-5, 0.0}) {
    Calibration truth = rig.factory;
    truth.cameras[0].time_drift = drift;
    const std::vector<MotionSegment> segments =
        SimulateApart(rig, truth, 6, 60, {.seed = 7});
    const Diagnosis diagnosis = Diagnose(rig, rig.factory, segments);
    const auto found =
        std::find_if(diagnosis.findings.begin(),
                     diagnosis.findings.end(),
                     [](const Finding& one) {
                       return one.kind == FindingKind::kClockDrift;
                     });
    if (drift == 0) {
      EXPECT_TRUE(diagnosis.findings.empty()) << Text(diagnosis);
      continue;
    }
    ASSERT_NE(found, diagnosis.findings.end()) << Text(diagnosis);
    std::cout << "drift " << 1e6 * drift << " us/s, found "
              << 1e6 * found->value << " us/s\n";
    EXPECT_NEAR(found->value, drift, 0.1 * std::abs(drift));
    Rig stated = rig;
    stated.factory = truth;
    EXPECT_TRUE(Diagnose(stated,
                         truth,
                         SimulateApart(stated, truth, 6, 60, {.seed = 7}))
                    .findings.empty());
  }
}

// Segments a minute apart of a session in which the SLAM system takes over a
// version: `before` segments with version 1, whose constant offset is that of
// the rig, then `after` with version 2, whose offset is larger by step_s.
std::vector<MotionSegment> SimulateTakeover(const Calibration& truth,
                                            int before,
                                            int after,
                                            double step_s) {
  std::vector<MotionSegment> all;
  Rig rig = HandheldRig("rig");
  const auto add = [&](std::int64_t version, int first, int count) {
    for (MotionSegment& segment :
         SimulateSingly(rig,
                        truth,
                        count,
                        {.seed = 7 + static_cast<std::uint64_t>(version)},
                        [&](int i, SimulationOptions*own) {
                          own->session_age_s = 60.0 * (first + i);
                        })) {
      segment.calibration_version = version;
      all.push_back(std::move(segment));
    }
  };
  add(1, 0, before);
  rig.factory.cameras[0].time_offset_s += step_s;
  add(2, before, after);
  return all;
}

bool FindsDrift(const Diagnosis& diagnosis) {
  const auto kinds = Kinds(diagnosis);
  return std::ranges::count(kinds, FindingKind::kClockDrift) > 0;
}

// States are late until the SLAM system knows the offset, and no longer after:
// over the time of the session that looks like a line.
TEST(Mistakes, AnOffsetThatTheSlamSystemTakesOverIsNoDriftOfClocks) {
  for (const double step_s : {-0.03, 0.02}) {
    Calibration truth = HandheldRig("rig").factory;
    truth.cameras[0].time_offset_s = step_s;
    for (const auto& [before, after] : {std::pair(12, 12),
                                        std::pair(8, 2),
                                        std::pair(3, 1),
                                        std::pair(2, 2),
                                        std::pair(1, 2)}) {
      const auto segments = SimulateTakeover(truth, before, after, step_s);
      const Diagnosis diagnosis = Diagnose(HandheldRig("rig"), truth, segments);
      EXPECT_FALSE(FindsDrift(diagnosis))
          << before << " segments before, " << after << " after\n"
          << Text(diagnosis);
    }
  }
}

TEST(Mistakes, ClocksThatDriftAreFoundAcrossVersions) {
  const Rig rig = HandheldRig("rig");
  for (const double drift : {-1e-4, 3e-5}) {
    Calibration truth = rig.factory;
    truth.cameras[0].time_offset_s = 0.02;
    truth.cameras[0].time_drift = drift;
    for (const auto& [before, after] :
         {std::pair(6, 6), std::pair(6, 1), std::pair(1, 6)}) {
      const auto segments = SimulateTakeover(truth, before, after, 0.02);
      const Diagnosis diagnosis = Diagnose(rig, rig.factory, segments);
      ASSERT_TRUE(FindsDrift(diagnosis)) << Text(diagnosis);
      const auto found = std::ranges::find(
          diagnosis.findings, FindingKind::kClockDrift, &Finding::kind);
      EXPECT_NEAR(found->value, drift, 0.1 * std::abs(drift));
    }
  }
}

// Rates cannot be checked at rest, and the diagnosis reports that.
TEST(Mistakes, OfTheGyroscopeAreNotCheckedAtRest) {
  FedData data = Simulated(HandheldRig("rig"), *MakeRest(40), 4);
  for (MotionSegment& segment : data.segments) {
    for (ImuSample& sample : segment.imu) sample.gyro *= -1;
  }
  const Diagnosis diagnosis = data.Diagnose();
  EXPECT_TRUE(diagnosis.findings.empty()) << Text(diagnosis);
  ASSERT_EQ(diagnosis.not_checked.size(), 2);  // the shutter is the other
  EXPECT_NE(diagnosis.not_checked[0].find("hardly turns"), std::string::npos);
}

}  // namespace
}  // namespace selfcal
