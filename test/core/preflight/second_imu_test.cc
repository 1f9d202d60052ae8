// Mistakes about the second IMU are found and named, with the first one and the
// keyframes as they should be, and clean data has none.
#include <gmock/gmock.h>

#include <cmath>
#include <cstdint>
#include <iostream>
#include <set>
#include <string>
#include <utility>

#include "core/model/so3.h"
#include "core/simulation/simulate.h"
#include "test/core/preflight/mistakes.h"
#include "test/promise.h"

namespace selfcal {
namespace {

using testing::HasSubstr;

Rig TwoImuRig() {
  Rig rig = HandheldRig("rig");
  AddSecondImu(&rig);
  return rig;
}

FedData Simulated(const Trajectory& trajectory, int seed) {
  const Rig rig = TwoImuRig();
  FedData data;
  data.rig = rig;
  data.rig.factory = PerturbCalibration(rig.factory, {}, seed);
  data.segments = Simulate(rig,
                           rig.factory,
                           data.rig.factory,
                           trajectory,
                           "session",
                           {.seed = static_cast<std::uint64_t>(seed)})
                      .segments;
  return data;
}

// Plants a mistake about the samples of the first IMU in those of the second.
void PlantInSecond(const Mistake& mistake, FedData* data) {
  const auto swap = [&] {
    for (MotionSegment& segment : data->segments) {
      std::swap(segment.imu, segment.imu1);
    }
  };
  swap();
  mistake.plant(data);
  swap();
}

void ExpectOnlySecond(const Diagnosis& diagnosis) {
  for (const Finding& finding : diagnosis.findings) {
    EXPECT_EQ(finding.imu, 1) << finding.cause;
    EXPECT_TRUE(finding.cause.starts_with("second IMU: ")) << finding.cause;
  }
}

// The only finding; a failure if there is another number of them.
Finding TheFinding(const Diagnosis& diagnosis) {
  EXPECT_EQ(diagnosis.findings.size(), 1u) << Text(diagnosis);
  ExpectOnlySecond(diagnosis);
  return diagnosis.findings.empty() ? Finding() : diagnosis.findings[0];
}

// Those of the readings alone: others are about the keyframes.
bool IsOfReadings(const Mistake& mistake) {
  static const std::set<std::string> kOfKeyframes = {"world_z_down",
                                                     "world_of_first_camera",
                                                     "images_30ms_late",
                                                     "images_150ms_early",
                                                     "gravity_removed"};
  return !kOfKeyframes.contains(mistake.name);
}

TEST(SecondImu, MistakesAboutItsReadingsAreFound) {
  int planted = 0;
  for (const double excitation : {0.2, 1.0}) {
    for (int seed = 1; seed <= Trials(1); ++seed) {
      const FedData clean =
          Simulated(*MakeHandheld(40, excitation, seed), seed);
      ASSERT_TRUE(clean.Diagnose().findings.empty()) << Text(clean.Diagnose());
      for (const Mistake& mistake : ImuMistakes()) {
        if (!IsOfReadings(mistake)) continue;
        SCOPED_TRACE(mistake.name);
        FedData fed = clean;
        PlantInSecond(mistake, &fed);
        const Diagnosis diagnosis = fed.Diagnose();
        ++planted;
        ASSERT_EQ(Kinds(diagnosis), mistake.found) << Text(diagnosis);
        ExpectOnlySecond(diagnosis);
        EXPECT_THAT(diagnosis.findings[0].cause, HasSubstr(mistake.cause));
      }
    }
  }
  EXPECT_GE(planted, 24);
}

TEST(SecondImu, AnInvertedPoseIsFound) {
  FedData fed = Simulated(*MakeHandheld(40, 1, 1), 1);
  SecondImuCalibration& imu = *fed.rig.factory.imu1;
  imu.p_JI = -(imu.q_JI.conjugate() * imu.p_JI);
  imu.q_JI = imu.q_JI.conjugate();
  const Finding finding = TheFinding(fed.Diagnose());
  EXPECT_EQ(finding.kind, FindingKind::kExtrinsics);
  EXPECT_THAT(finding.cause, HasSubstr("inverted"));
  EXPECT_THAT(finding.remedy, HasSubstr("invert imu1.q_JI"));
}

TEST(SecondImu, AnotherPoseIsAMismatchThatNamesIt) {
  FedData fed = Simulated(*MakeHandheld(40, 1, 1), 1);
  SecondImuCalibration& imu = *fed.rig.factory.imu1;
  imu.q_JI = Exp({0.5, -0.4, 0.3}) * imu.q_JI;
  const Diagnosis diagnosis = fed.Diagnose();
  ASSERT_FALSE(diagnosis.findings.empty()) << Text(diagnosis);
  ExpectOnlySecond(diagnosis);
  EXPECT_EQ(diagnosis.findings[0].kind, FindingKind::kGyroMismatch);
  EXPECT_THAT(diagnosis.findings[0].remedy, HasSubstr("imu1.q_JI"));
}

TEST(SecondImu, ATimeOffsetIsFoundUnlessItIsStated) {
  for (const double offset_s : {-0.03, 0.012}) {
    FedData fed = Simulated(*MakeHandheld(40, 1, 1), 1);
    for (MotionSegment& segment : fed.segments) {
      for (ImuSample& sample : segment.imu1) {
        sample.t_ns -= static_cast<std::int64_t>(1e9 * offset_s);
      }
    }
    const Finding finding = TheFinding(fed.Diagnose());
    EXPECT_EQ(finding.kind, FindingKind::kTimeOffset);
    EXPECT_NEAR(finding.value, -offset_s, 1e-3);
    EXPECT_THAT(finding.remedy, HasSubstr("to imu1.time_offset"));
    fed.rig.factory.imu1->time_offset_s = offset_s;
    EXPECT_TRUE(fed.Diagnose().findings.empty()) << Text(fed.Diagnose());
  }
}

// Biases of uncalibrated parts are no finding.
TEST(SecondImu, CleanDataGivesNoFinding) {
  int sessions = 0;
  for (const double excitation : {0.1, 0.3, 1.0}) {
    for (int seed = 1; seed <= Trials(4); ++seed) {
      FedData fed = Simulated(*MakeHandheld(12, excitation, seed), seed);
      for (const double bias : {0.0, 0.1}) {
        for (MotionSegment& segment : fed.segments) {
          for (ImuSample& sample : segment.imu1) {
            sample.gyro += bias * Eigen::Vector3d(1, -1, 0.5);
            sample.accel += 5 * bias * Eigen::Vector3d(-1, 0.5, 1);
          }
        }
        const Diagnosis diagnosis = fed.Diagnose();
        EXPECT_TRUE(diagnosis.findings.empty())
            << excitation << ", bias " << bias << ", seed " << seed << "\n"
            << Text(diagnosis);
        ++sessions;
      }
    }
  }
  std::cout << sessions << " sessions\n";
}

// Wrong readings of the first one say nothing about the second.
TEST(SecondImu, IsNotCheckedBeforeTheFirstIsCorrect) {
  FedData fed = Simulated(*MakeHandheld(40, 1, 1), 1);
  for (MotionSegment& segment : fed.segments) {
    for (ImuSample& sample : segment.imu) sample.accel *= -1;
  }
  const Diagnosis diagnosis = fed.Diagnose();
  ASSERT_EQ(diagnosis.findings.size(), 1u) << Text(diagnosis);
  EXPECT_EQ(diagnosis.findings[0].imu, 0);
  EXPECT_THAT(diagnosis.not_checked,
              testing::Contains(HasSubstr("second IMU: axes, units")));
}

TEST(SecondImu, DataThatIsNotUsableIsIgnored) {
  FedData fed = Simulated(*MakeHandheld(20, 1, 1), 1);
  fed.segments[0].imu1[5].gyro.x() = std::nan("");
  fed.segments[0].imu1[6].accel.setConstant(HUGE_VAL);
  fed.segments[0].imu1[7].t_ns = fed.segments[0].imu1[2].t_ns;
  fed.segments[0].keyframes[3].q_GI.coeffs().setZero();
  fed.segments[1].imu1.clear();
  fed.segments[2].imu.clear();
  fed.segments.emplace_back();
  const Diagnosis diagnosis = fed.Diagnose();
  EXPECT_TRUE(diagnosis.findings.empty()) << Text(diagnosis);
}

}  // namespace
}  // namespace selfcal
