// The estimator on recordings of a few seconds: nothing is made up where they
// show little.
#include <gtest/gtest.h>

#include <cmath>
#include <iostream>

#include "client/demo/device.h"
#include "core/calibration/calibrate.h"
#include "core/information/segment_information.h"
#include "test/recordings.h"

namespace selfcal::client {
namespace {

void PrintDirections(const std::string& what,
                     const std::vector<UnobservedDirection>& directions) {
  for (const UnobservedDirection& direction : directions) {
    std::cout << what << ", ratio " << direction.information_ratio << ":";
    for (const auto& part : direction.parts) {
      std::cout << " " << part.component << " " << part.weight;
    }
    std::cout << "\n";
  }
}

// Each direction that the prior knows better has a name and a ratio below 1.
void ExpectNamed(const std::vector<UnobservedDirection>& directions) {
  for (const UnobservedDirection& direction : directions) {
    EXPECT_FALSE(direction.parts.empty());
    EXPECT_GE(direction.information_ratio, 0);
    EXPECT_LT(direction.information_ratio, 1);
  }
}

// Number of weak directions of one segment.
int ScoreAndCheck(const Rig& rig, const MotionSegment& segment) {
  EXPECT_TRUE(Validate(segment, rig.factory).empty());
  const SegmentInformation information =
      ScoreSegment(rig, rig.factory, segment);
  EXPECT_TRUE(information.Lambda.allFinite());
  EXPECT_TRUE(information.eta.allFinite());
  EXPECT_TRUE(std::isfinite(information.residuals.reprojection_rms_px));
  EXPECT_EQ(information.rank + static_cast<int>(information.unobserved.size()),
            static_cast<int>(FreeComponents(rig).size()));
  ExpectNamed(information.unobserved);
  for (const GroupScore& score : information.groups) {
    EXPECT_TRUE(std::isfinite(score.entropy)) << score.group;
    EXPECT_GE(score.gain, 0) << score.group;
    EXPECT_EQ(score.rank + static_cast<int>(score.unobserved.size()),
              score.size);
    ExpectNamed(score.unobserved);
  }
  PrintDirections("segment " + std::to_string(segment.key.index),
                  information.unobserved);
  return static_cast<int>(information.unobserved.size());
}

CalibrationResult CalibrateAndCheck(const Device& device) {
  const CalibrationResult result = Calibrate(
      device.rig, device.rig.factory, device.segments, {.threads = 2});
  EXPECT_EQ(result.status, CalibrateStatus::kConverged) << result.message;
  EXPECT_TRUE(Validate(result.theta, "theta").empty());
  EXPECT_TRUE(ReadableValues(result.theta).allFinite());
  EXPECT_TRUE(result.covariance.allFinite());
  const std::vector<int> free = FreeComponents(device.rig);
  EXPECT_GT(result.covariance.diagonal()(free).minCoeff(), 0);
  EXPECT_LT(result.reprojection_rms_after_px,
            result.reprojection_rms_before_px);
  EXPECT_EQ(result.rank + static_cast<int>(result.held_constant.size()),
            static_cast<int>(free.size()));
  ExpectNamed(result.held_constant);
  PrintDirections("held constant", result.held_constant);
  return result;
}

// Largest posterior sigma against the prior's, and whose it is.
double WeakestRatio(const Rig& rig, const CalibrationResult& result) {
  int weakest = 0;
  const double ratio = result.covariance.diagonal()
                           .cwiseSqrt()
                           .cwiseQuotient(PriorSigmas(rig))
                           .maxCoeff(&weakest);
  std::cout << result.segments << " segments, " << result.iterations
            << " iterations, rank " << result.rank << ", rms "
            << result.reprojection_rms_before_px << " -> "
            << result.reprojection_rms_after_px << " px; weakest "
            << TangentComponents(result.theta)[weakest].name << ", " << ratio
            << " of its prior sigma\n";
  return ratio;
}

// This flight excites everything: nothing is weak, so nothing is named, and
// every component is known better than before.
TEST(ShortRecordings, EurocFlightDeterminesEveryDirection) {
  SELFCAL_NEED_RECORDING(path, "euroc_v1_01");
  const auto device = ReadDevice({path}, {20, {}, {}});
  ASSERT_TRUE(device.ok()) << device.status();
  for (const MotionSegment& segment : device->segments) {
    EXPECT_EQ(ScoreAndCheck(device->rig, segment), 0) << segment.key.index;
  }
  const CalibrationResult result = CalibrateAndCheck(*device);
  EXPECT_TRUE(result.held_constant.empty());
  EXPECT_LT(WeakestRatio(device->rig, result), 1);
}

// A segment of this one leaves a direction to the prior, and says which.
TEST(ShortRecordings, TheRoomNamesWhatASegmentDoesNotShow) {
  SELFCAL_NEED_RECORDING(path, "equidistant_room");
  const auto device = ReadDevice({path}, {20, {}, {}});
  ASSERT_TRUE(device.ok()) << device.status();
  int weak = 0;
  for (const MotionSegment& segment : device->segments) {
    weak += ScoreAndCheck(device->rig, segment);
  }
  EXPECT_GT(weak, 0);
  const CalibrationResult result = CalibrateAndCheck(*device);
  WeakestRatio(device->rig, result);
}

}  // namespace
}  // namespace selfcal::client
