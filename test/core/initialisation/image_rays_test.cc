#include "core/initialisation/image_rays.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <vector>

#include "test/core/model/random_values.h"

namespace selfcal {
namespace {

// Points that move to the right; one leaves and one comes with each image.
std::vector<TrackedImage> MovingPoints(int images, double step_px) {
  std::vector<TrackedImage> moving;
  for (int k = 0; k < images; ++k) {
    TrackedImage image{1'000 + k * 50'000'000ll, {}};
    for (int i = 0; i < 40; ++i) {
      const std::uint64_t landmark =
          static_cast<std::uint64_t>(k) + static_cast<std::uint64_t>(i);
      image.points.push_back(
          {landmark,
           {200 + 3 * static_cast<double>(landmark % 7) + step_px * k,
            240.0 + static_cast<double>(landmark)}});
    }
    moving.push_back(std::move(image));
  }
  return moving;
}

CameraCalibration Pinhole() {
  CameraCalibration camera;
  camera.model = DistortionModel::kRadialTangential;
  camera.distortion = DistortionVector::Zero(4);
  camera.f = {400, 400};
  camera.c = {320, 240};
  camera.width_px = 640;
  camera.height_px = 480;
  return camera;
}

TEST(RayImages, RaysAreThoseOfTheScaledCameraWithTheirDerivatives) {
  const double scale = 1.2;
  RayImages rays(Pinhole(), MovingPoints(3, 5), 1'000);
  rays.SetFocalScale(scale);
  EXPECT_NEAR(rays.px_per_rad(), 480, 1e-9);
  ASSERT_EQ(rays.images().size(), 3u);
  EXPECT_NEAR(rays.images()[2].t_s, 0.1, 1e-12);
  for (const ImagePoint& point : rays.images()[2].points) {
    const Eigen::Vector2d u = (point.z_px - Pinhole().c) / (scale * 400);
    const Eigen::Vector3d ray = u.homogeneous();
    EXPECT_LT((point.ray_C - ray.normalized()).norm(), 1e-12);
    // u falls as the scale grows.
    const Eigen::Vector3d by_scale(-u.x(), -u.y(), 0);
    const Eigen::Vector3d expected =
        (by_scale - point.ray_C * point.ray_C.dot(by_scale)) / ray.norm();
    EXPECT_LT((point.by_scale - expected).norm(), 1e-7);
  }
}

TEST(RayImages, NoiseHasItsSigmaAndAnOpposite) {
  const std::vector<TrackedImage> images = MovingPoints(100, 1);
  RayImages plus(Pinhole(), images, 0);
  const RayImages clean = plus;
  RayImages minus = plus;
  plus.AddNoise(0.5, 7);
  minus.AddNoise(-0.5, 7);
  double squares = 0, values = 0;
  for (std::size_t k = 0; k < images.size(); ++k) {
    for (std::size_t i = 0; i < clean.images()[k].points.size(); ++i) {
      const Eigen::Vector2d at = clean.images()[k].points[i].z_px;
      const Eigen::Vector2d moved = plus.images()[k].points[i].z_px - at;
      EXPECT_LT((moved + minus.images()[k].points[i].z_px - at).norm(), 1e-12);
      squares += moved.squaredNorm();
      values += 2;
    }
  }
  EXPECT_NEAR(std::sqrt(squares / values), 0.5, 0.02);
}

TEST(ChainPairs, LinksImagesOverTheIntervalWithTheirCommonPoints) {
  const RayImages rays(Pinhole(), MovingPoints(21, 1), 0);
  const std::vector<ImagePair> pairs = ChainPairs(rays.images(), 0.201);
  ASSERT_EQ(pairs.size(), 5u);
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    EXPECT_EQ(pairs[k].from, 4 * static_cast<int>(k));
    EXPECT_EQ(pairs[k].to, pairs[k].from + 4);
    EXPECT_EQ(pairs[k].matches.size(), 36u);
    for (const auto& [i, j] : pairs[k].matches) {
      EXPECT_EQ(rays.images()[pairs[k].from].points[i].landmark,
                rays.images()[pairs[k].to].points[j].landmark);
    }
  }
}

TEST(ChainPairs, GoesOnUntilPointsHaveMovedAsLongAsHalfOfThemAreCommon) {
  // 400 px/rad: a flow of 0.02 rad takes 4 images of 2 px at the axis.
  const RayImages slow(Pinhole(), MovingPoints(31, 2), 0);
  const std::vector<ImagePair> pairs = ChainPairs(slow.images(), 0.06, 0.02);
  ASSERT_FALSE(pairs.empty());
  EXPECT_GE(pairs[0].to, 4);
  EXPECT_LE(pairs[0].to, 8);
  // Half of 40 points are left after 20 images, but half a second has 10.
  const RayImages still(Pinhole(), MovingPoints(31, 0), 0);
  EXPECT_EQ(ChainPairs(still.images(), 0.06, 1.0)[0].to, 10);
}

TEST(ChainPairs, LeavesOutImagesThatAreFarApartOrHaveNothingInCommon) {
  std::vector<TrackedImage> images = MovingPoints(6, 1);
  for (std::size_t k = 3; k < 6; ++k) images[k].t_ns += 1'000'000'000;
  for (TrackedPoint& point : images[5].points) point.landmark += 1'000;
  const RayImages rays(Pinhole(), images, 0);
  const std::vector<ImagePair> pairs = ChainPairs(rays.images(), 0.06);
  ASSERT_EQ(pairs.size(), 3u);
  EXPECT_EQ(pairs[1].to, 2);
  EXPECT_EQ(pairs[2].from, 3);
  EXPECT_EQ(pairs[2].to, 4);
}

}  // namespace
}  // namespace selfcal
