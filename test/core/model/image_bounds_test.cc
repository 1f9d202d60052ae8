#include "core/model/image_bounds.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <string_view>
#include <vector>

#include "core/model/camera_model.h"
#include "test/core/model/special_values.h"

namespace selfcal {
namespace {

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

// A lens, and the largest radius in (z - c) / f of its rays.
struct Lens {
  std::string_view model;
  std::vector<double> coefficients;
  double end;
};

std::vector<Lens> Lenses() {
  return {{"fov", {0.92}, std::numbers::pi / 2 / 0.92},
          // r + k r^3 and theta + k theta^3 have their largest value, two
          // thirds of the argument, where 3 k times its square is -1.
          {"radial-tangential", {-0.28, 0, 0, 0}, 2 / std::sqrt(27 * 0.28)},
          {"equidistant", {-0.05, 0, 0, 0}, 2 / std::sqrt(27 * 0.05)},
          // The root S of the inverses is zero.
          {"unified", {1.2, 0, 0, 0, 0}, 1 / std::sqrt(1.2 * 1.2 - 1)},
          {"extended-unified", {0.6, 1.1}, 1 / std::sqrt(1.1 * (2 * 0.6 - 1))},
          {"double-sphere", {-0.18, 0.59}, 1 / std::sqrt(2 * 0.59 - 1)}};
}

// Its rays end at this radius.
CameraCalibration CameraOf(const Lens& lens, double end_px) {
  CameraCalibration camera = OneCamera().cameras[0];
  for (const DistortionModel model : DistortionModels()) {
    if (DistortionName(model) == lens.model) camera.model = model;
  }
  camera.distortion = Eigen::Map<const Eigen::VectorXd>(
      lens.coefficients.data(),
      static_cast<Eigen::Index>(lens.coefficients.size()));
  camera.f.setConstant(end_px / lens.end);
  camera.c = {310, 245};
  return camera;
}

TEST(EndOfRays, IsAtTheLargestRadius) {
  constexpr double kEnd_px = 300;
  constexpr double kReach_px = 4;
  for (const Lens& lens : Lenses()) {
    SCOPED_TRACE(lens.model);
    const CameraCalibration camera = CameraOf(lens, kEnd_px);
    for (const double distance_px : {0.5, 1.0, 3.9, 5.0, 90.0}) {
      for (const double angle : {0.0, 2.0, 4.0}) {
        const Eigen::Vector2d z_px =
            camera.c + (kEnd_px - distance_px) *
                           Eigen::Vector2d(std::cos(angle), std::sin(angle));
        EXPECT_NEAR(DistanceToLastRay(camera, z_px, kReach_px),
                    std::min(distance_px, kReach_px),
                    1e-3 * kReach_px);
      }
    }
    EXPECT_EQ(DistanceToLastRay(camera, camera.c, kReach_px), kReach_px);
  }
}

TEST(EndOfRays, IsBeyondTheFurthestCornerIfTheRaysCoverTheImage) {
  // That of (640, 0), from (310, 245), 1 px outside.
  const double corner_px = std::hypot(331, 246);
  for (const Lens& lens : Lenses()) {
    SCOPED_TRACE(lens.model);
    EXPECT_TRUE(CoversImage(CameraOf(lens, corner_px + 0.1), 1));
    EXPECT_FALSE(CoversImage(CameraOf(lens, corner_px - 0.1), 1));
  }
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
