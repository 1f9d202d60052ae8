#include "core/model/image_bounds.h"

#include <gtest/gtest.h>

#include <limits>

namespace selfcal {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

Calibration OneCamera() {
  Calibration theta;
  theta.cameras.resize(1);
  theta.cameras[0].width_px = 640;
  theta.cameras[0].height_px = 480;
  return theta;
}

// 1000 observations within the image.
MotionSegment Within() {
  MotionSegment segment;
  segment.landmarks.resize(10);
  for (int i = 0; i < 1000; ++i) {
    segment.observations.push_back({0, 0, i % 10, {i % 640, i % 480}});
  }
  return segment;
}

TEST(ImageBounds, IncludeTheMargin) {
  const CameraCalibration camera = OneCamera().cameras[0];
  EXPECT_TRUE(IsInImage(camera, {-1, 481}, 1));
  EXPECT_TRUE(IsInImage(camera, {641, -1}, 1));
  EXPECT_FALSE(IsInImage(camera, {-1.01, 5}, 1));
  EXPECT_FALSE(IsInImage(camera, {5, -1.01}, 1));
  EXPECT_FALSE(IsInImage(camera, {641.01, 5}, 1));
  EXPECT_FALSE(IsInImage(camera, {5, 481.01}, 1));
  EXPECT_FALSE(IsInImage(camera, {kNan, 5}, 1));
}

TEST(StrayObservations, AreRemovedIfTheyAreFew) {
  MotionSegment segment = Within();
  for (int i = 0; i < 20; ++i) segment.observations[40 * i].z_px.x() = 700;
  EXPECT_EQ(CountStrayObservations(segment, OneCamera()), 20u);
  RemoveStrayObservations(OneCamera(), {}, &segment);
  EXPECT_EQ(segment.observations.size(), 980u);
  EXPECT_EQ(segment.landmarks.size(), 10u);
  for (const Observation& o : segment.observations) {
    EXPECT_LE(o.z_px.x(), 641);
  }
}

TEST(StrayObservations, AreLeftToTheValidationIfTheyAreMany) {
  MotionSegment segment = Within();
  for (int i = 0; i < 21; ++i) segment.observations[40 * i].z_px.x() = 700;
  EXPECT_EQ(CountStrayObservations(segment, OneCamera()), 0u);
  RemoveStrayObservations(OneCamera(), {}, &segment);
  EXPECT_EQ(segment.observations.size(), 1000u);
}

TEST(StrayObservations, AreNotThoseThatAreWrongInAnotherWay) {
  MotionSegment segment = Within();
  segment.observations[0].z_px.x() = kNan;
  segment.observations[1].z_px.x() = std::numeric_limits<double>::infinity();
  segment.observations[2].camera = 1;
  segment.observations[3].camera = -1;
  for (int i = 2; i < 4; ++i) segment.observations[i].z_px.x() = 700;
  EXPECT_EQ(CountStrayObservations(segment, OneCamera()), 0u);
}

TEST(StrayObservations, AreNoneInASegmentWithoutObservations) {
  EXPECT_EQ(CountStrayObservations({}, OneCamera()), 0u);
}

}  // namespace
}  // namespace selfcal
