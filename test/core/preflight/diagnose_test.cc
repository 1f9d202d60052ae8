#include "core/preflight/diagnose.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <set>

#include "core/simulation/simulate.h"
#include "test/core/preflight/mistakes.h"

namespace selfcal {
namespace {

FedData Clean() {
  FedData data;
  data.rig = HandheldRig("rig");
  data.segments = Simulate(data.rig,
                           data.rig.factory,
                           data.rig.factory,
                           *MakeHandheld(20, 1, 1),
                           "session",
                           {})
                      .segments;
  return data;
}

TEST(Diagnose, NamesEveryKind) {
  std::set<std::string_view> names;
  constexpr int kKinds =
      static_cast<int>(FindingKind::kReprojectionMismatch) + 1;
  for (int kind = 0; kind < kKinds; ++kind) {
    names.insert(FindingName(static_cast<FindingKind>(kind)));
  }
  EXPECT_EQ(names.size(), kKinds);
  EXPECT_FALSE(names.contains(""));
}

TEST(Diagnose, ReportsForNoDataThatNothingWasChecked) {
  const Rig rig = HandheldRig("rig");
  const Diagnosis diagnosis = Diagnose(rig, rig.factory, {});
  EXPECT_TRUE(diagnosis.findings.empty());
  EXPECT_TRUE(diagnosis.checked.empty());
  EXPECT_EQ(diagnosis.not_checked.size(), 6);
}

// A gap of 75 ms is only a few in a thousand of 4000 samples.
TEST(Diagnose, NamesASingleLongGap) {
  FedData data = Clean();
  std::vector<ImuSample>& imu = data.segments[2].imu;
  imu.erase(imu.begin() + 300, imu.begin() + 314);
  const Diagnosis diagnosis =
      Diagnose(data.rig, data.rig.factory, data.segments);
  ASSERT_EQ(diagnosis.findings.size(), 1u);
  EXPECT_EQ(diagnosis.findings[0].kind, FindingKind::kDroppedSamples);
  EXPECT_THAT(diagnosis.findings[0].cause,
              testing::HasSubstr("in 1 gap of 75 ms"));
}

TEST(Diagnose, IgnoresUnusableData) {
  FedData data = Clean();
  MotionSegment& segment = data.segments[0];
  segment.imu[5].gyro.x() = std::nan("");
  segment.imu[6].accel.setConstant(HUGE_VAL);
  segment.imu[7].t_ns = segment.imu[2].t_ns;
  segment.keyframes[3].q_GI.coeffs().setZero();
  segment.keyframes[4].p_GI.y() = std::nan("");
  segment.keyframes[7].t_ns = 0;
  segment.landmarks[1].p_G.x() = std::nan("");
  segment.observations[2].keyframe = -1;
  segment.observations[3].landmark = 1 << 30;
  segment.observations[4].camera = 7;
  segment.observations[5].z_px.x() = HUGE_VAL;
  data.segments.emplace_back();
  const Diagnosis diagnosis = data.Diagnose();
  EXPECT_TRUE(diagnosis.findings.empty()) << Text(diagnosis);
}

TEST(Diagnose, FindsTimestampsThatDoNotIncrease) {
  FedData data = Clean();
  for (MotionSegment& segment : data.segments) {
    for (std::size_t i = 20; i < segment.imu.size(); i += 20) {
      segment.imu[i].t_ns = segment.imu[i - 1].t_ns;
    }
  }
  const Diagnosis diagnosis = data.Diagnose();
  ASSERT_TRUE(std::any_of(diagnosis.findings.begin(),
                          diagnosis.findings.end(),
                          [](const auto& f) {
                            return f.kind == FindingKind::kRepeatedSamples &&
                                   f.cause.find("do not increase") !=
                                       std::string::npos;
                          }))
      << Text(diagnosis);
}

// Samples of another recording do not fit any hypothesis, and that is reported.
TEST(Diagnose, ReportsThatSamplesOfAnotherRecordingDoNotFit) {
  FedData data = Clean();
  const auto other = Simulate(data.rig,
                              data.rig.factory,
                              data.rig.factory,
                              *MakeHandheld(20, 1, 99),
                              "session",
                              {});
  for (std::size_t s = 0; s < data.segments.size(); ++s) {
    data.segments[s].imu = other.segments[s].imu;
  }
  const auto kinds = Kinds(data.Diagnose());
  EXPECT_TRUE(
      std::count(kinds.begin(), kinds.end(), FindingKind::kGyroMismatch));
}

TEST(Diagnose, ReportsThatLandmarksOfOtherObservationsDoNotFit) {
  FedData data = Clean();
  std::mt19937 random(1);
  for (MotionSegment& segment : data.segments) {
    for (std::size_t i = segment.landmarks.size(); i > 1; --i) {
      std::swap(segment.landmarks[i - 1].p_G,
                segment.landmarks[random() % i].p_G);
    }
  }
  EXPECT_EQ(Kinds(data.Diagnose()),
            std::vector{FindingKind::kReprojectionMismatch})
      << Text(data.Diagnose());
}

TEST(Diagnose, AcceptsASensorThatReadsInSteps) {
  FedData data = Clean();
  const auto coarse = [](double value, double step) {
    return std::round(value / step) * step;
  };
  for (MotionSegment& segment : data.segments) {
    for (ImuSample& sample : segment.imu) {
      for (int i = 0; i < 3; ++i) {
        sample.gyro[i] = coarse(sample.gyro[i], 2e-3);
        sample.accel[i] = coarse(sample.accel[i], 8e-3);
      }
    }
  }
  const Diagnosis diagnosis = data.Diagnose();
  EXPECT_TRUE(diagnosis.findings.empty()) << Text(diagnosis);
}

}  // namespace
}  // namespace selfcal
