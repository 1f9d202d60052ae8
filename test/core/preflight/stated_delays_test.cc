// Cameras whose exposures are later or earlier than their stamps, by offsets
// and line delays that the calibration states.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <set>
#include <string>
#include <vector>

#include "core/simulation/simulate.h"
#include "test/core/preflight/expect_found.h"
#include "test/core/preflight/mistakes.h"
#include "test/core/simulation/rigs.h"

namespace selfcal {
namespace {

constexpr double kStatedReadout_s = 0.033;

Calibration WithDelays(Calibration theta, double offset_s, double readout_s) {
  for (CameraCalibration& camera : theta.cameras) {
    camera.time_offset_s = offset_s;
    if (readout_s == 0) continue;
    camera.line_delay_s = readout_s / camera.height_px;
  }
  return theta;
}

// A device that turns about the vertical at a constant rate, and moves along a
// circle of 0.3 m with it, as on a turntable.
class SteadyTurn : public Trajectory {
 public:
  double duration_s() const override { return 20; }
  BodyMotion At(double t_s) const override {
    constexpr double kRate_radps = 0.5, kRadius_m = 0.3;
    const double angle = kRate_radps * t_s;
    const Eigen::Vector3d out(std::cos(angle), std::sin(angle), 0);
    BodyMotion motion;
    motion.q_GI = Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitZ()) *
                  Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitX());
    motion.p_GI = kRadius_m * out;
    motion.v_GI = kRadius_m * kRate_radps *
                  Eigen::Vector3d(-std::sin(angle), std::cos(angle), 0);
    motion.a_GI = -kRadius_m * kRate_radps * kRate_radps * out;
    motion.w_I = motion.q_GI.conjugate() * Eigen::Vector3d(0, 0, kRate_radps);
    motion.dw_I.setZero();
    return motion;
  }
};

std::vector<MotionSegment> SegmentsOf(const Rig& rig,
                                      const Calibration& truth,
                                      const Calibration& slam,
                                      const Trajectory& trajectory,
                                      int seed) {
  SimulationOptions options;
  options.seed = static_cast<std::uint64_t>(seed);
  options.landmarks_in_view = 60;
  return Simulate(rig,
                  truth,
                  PerturbCalibration(slam, {}, options.seed),
                  trajectory,
                  "session",
                  options)
      .segments;
}

TEST(StatedDelays, AreNoFindingInVigorousMotion) {
  for (const Rig& rig : {HandheldRig("a"), StereoRig()}) {
    for (const double offset_s : {-0.1, 0.1}) {
      for (const double readout_s : {0.0, kStatedReadout_s}) {
        const Calibration truth = WithDelays(rig.factory, offset_s, readout_s);
        for (int seed = 1; seed <= 3; ++seed) {
          const Diagnosis diagnosis = Diagnose(
              rig,
              truth,
              SegmentsOf(rig, truth, truth, *MakeHandheld(12, 1, seed), seed));
          EXPECT_TRUE(diagnosis.findings.empty())
              << rig.factory.cameras.size() << " cameras, offset " << offset_s
              << ", readout " << readout_s << "\n"
              << Text(diagnosis);
        }
      }
    }
  }
}

// In one direction all pixels are off in the same way, which looks as if the
// image were cropped; and the gyroscope does not tell one time from another.
TEST(StatedDelays, AreNoFindingInASteadyTurn) {
  const Rig rig = HandheldRig("a");
  for (const double offset_s : {-0.1, 0.1}) {
    for (const double readout_s : {0.0, kStatedReadout_s}) {
      const Calibration truth = WithDelays(rig.factory, offset_s, readout_s);
      for (const Calibration& slam :
           {truth, WithDelays(rig.factory, 0, readout_s)}) {
        const Diagnosis diagnosis =
            Diagnose(rig, truth, SegmentsOf(rig, truth, slam, SteadyTurn(), 1));
        EXPECT_TRUE(diagnosis.findings.empty())
            << "offset " << offset_s << ", of the SLAM system "
            << slam.cameras[0].time_offset_s << "\n"
            << Text(diagnosis);
      }
    }
  }
}

// States and landmarks of an older version, which knew less of the offset or
// nothing, agree with the pixels at their stamps.
TEST(StatedDelays, AreNoFindingWhereTheSlamSystemDidNotKnowThem) {
  for (const Rig& rig : {HandheldRig("a"), StereoRig()}) {
    for (const double offset_s : {-0.1, 0.1}) {
      for (const double known : {0.0, 0.5}) {
        const Calibration truth = WithDelays(rig.factory, offset_s, 0);
        const Calibration slam = WithDelays(rig.factory, known * offset_s, 0);
        const auto segments =
            SegmentsOf(rig, truth, slam, *MakeHandheld(12, 1, 2), 2);
        const Diagnosis diagnosis = Diagnose(rig, truth, segments);
        const auto kinds = Kinds(diagnosis);
        EXPECT_EQ(std::ranges::count_if(kinds,
                                        [](FindingKind kind) {
                                          return kind !=
                                                 FindingKind::kTimeOffset;
                                        }),
                  0)
            << Text(diagnosis);
      }
    }
  }
}

// A session within which the SLAM system takes the offset over.
TEST(StatedDelays, AreNoFindingWhereTheSlamSystemLearnsThem) {
  const Rig rig = HandheldRig("a");
  const Calibration truth = WithDelays(rig.factory, 0.1, 0);
  const auto trajectory = MakeHandheld(12, 1, 3);
  auto segments = SegmentsOf(rig, truth, rig.factory, *trajectory, 3);
  const auto after = SegmentsOf(rig, truth, truth, *trajectory, 4);
  segments.insert(segments.end(), after.begin(), after.end());
  const Diagnosis diagnosis = Diagnose(rig, truth, segments);
  for (const FindingKind kind : Kinds(diagnosis)) {
    EXPECT_EQ(kind, FindingKind::kTimeOffset) << Text(diagnosis);
  }
}

// Mistakes about cameras are named beside a stated offset as without one. Those
// of poses and anchors are planted at the stamps, not at the exposures: they
// are not told from others there.
TEST(StatedDelays, HideNoMistakeAboutCameras) {
  const std::set<std::string> at_stamps = {
      "camera_poses", "poses_by_inverted_extrinsics", "landmarks_in_camera"};
  for (const double offset_s : {-0.1, 0.1}) {
    SCOPED_TRACE(offset_s);
    FedData clean;
    clean.rig = HandheldRig("a");
    const Calibration truth = WithDelays(clean.rig.factory, offset_s, 0);
    clean.segments =
        SegmentsOf(clean.rig, truth, truth, *MakeHandheld(20, 1, 5), 5);
    clean.rig.factory = PerturbCalibration(truth, {}, 5);
    for (const Mistake& mistake : CameraMistakes()) {
      if (!at_stamps.contains(mistake.name)) {
        ExpectFound(mistake, clean);
        continue;
      }
      FedData fed = clean;
      mistake.plant(&fed);
      EXPECT_FALSE(fed.Diagnose().findings.empty()) << mistake.name;
    }
  }
}

}  // namespace
}  // namespace selfcal
