// The borders of the regions of the models that project through a sphere.
#include "core/model/axial_camera.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "core/model/camera_double_sphere.h"
#include "core/model/camera_extended_unified.h"
#include "core/model/camera_unified.h"
#include "test/core/model/random_values.h"

namespace selfcal {
namespace {

constexpr int kAxialTrials = 3000;
constexpr PixelMap kAxialPlane = {{1, 1}, {0, 0}};
// Where coordinates go to infinity, the region ends this early.
constexpr double kGap = 1e-5;

template <class Model>
bool IsValid(const Model& model, const Eigen::Vector3d& p_C) {
  Eigen::Vector2d d;
  return model.template Project<double>(kAxialPlane, p_C, &d, nullptr);
}

// The region is the cone of the rays whose cosine of the angle from the axis
// is above `cosine`.
template <class Model>
void ExpectRegionEndsAt(const Model& model,
                        double cosine,
                        const Eigen::Vector2d& direction) {
  const auto at = [&](double z) {
    return Eigen::Vector3d(std::sqrt(1 - z * z) * direction.x(),
                           std::sqrt(1 - z * z) * direction.y(),
                           z);
  };
  EXPECT_TRUE(IsValid(model, at(cosine + kGap))) << cosine;
  EXPECT_FALSE(IsValid(model, at(cosine - 1e-12))) << cosine;
  for (const double part : {0.01, 0.3, 0.7, 0.99}) {
    EXPECT_TRUE(IsValid(model, at(cosine + part * (1 - cosine))));
    EXPECT_FALSE(IsValid(model, at(cosine - part * (1 + cosine))));
  }
}

TEST(CameraUnified, RegionEndsAtTheClosedForm) {
  RandomValues random(1);
  for (int i = 0; i < kAxialTrials; ++i) {
    const double xi = random.Uniform(0.01, 3);
    const CameraUnified model(std::array{xi, 0.0, 0.0, 0.0, 0.0});
    ExpectRegionEndsAt(
        model, -std::min(xi, 1 / xi), random.Vector(2, 1).normalized());
  }
}

TEST(CameraUnified, LargestRadiusIsTheClosedForm) {
  RandomValues random(2);
  for (int i = 0; i < kAxialTrials; ++i) {
    const double xi = random.Uniform(1.01, 3);
    const double largest = 1 / std::sqrt(xi * xi - 1);
    const CameraUnified model(std::array{xi, 0.0, 0.0, 0.0, 0.0});
    const Eigen::Vector2d direction = random.Vector(2, 1).normalized();
    Eigen::Vector3d ray;
    EXPECT_TRUE(model.Unproject(largest * (1 - 1e-9) * direction, &ray));
    EXPECT_NEAR(ray.normalized().z(), -1 / xi, 1e-3);
    EXPECT_FALSE(model.Unproject(largest * (1 + 1e-9) * direction, &ray));
  }
}

TEST(CameraUnified, RegionEndsWhereTheDistortionStopsRising) {
  RandomValues random(3);
  for (int i = 0; i < kAxialTrials; ++i) {
    // sin(theta) / (cos(theta) + 1) is tan(theta / 2); 1 + 3 k1 q is zero.
    const double theta = random.Uniform(0.5, 2.8);
    const double k1 = -1 / (3 * std::pow(std::tan(theta / 2), 2));
    const CameraUnified model(std::array{1.0, k1, 0.0, 0.0, 0.0});
    ExpectRegionEndsAt(
        model, std::cos(theta), random.Vector(2, 1).normalized());
  }
}

TEST(CameraExtendedUnified, RegionEndsAtTheClosedForm) {
  RandomValues random(4);
  for (int i = 0; i < kAxialTrials; ++i) {
    const double alpha = random.Uniform(0.01, 0.99);
    const double beta = random.Uniform(0.3, 3);
    const CameraExtendedUnified model(std::array{alpha, beta});
    // Z > -c D, with c as in the unified model of xi = alpha / (1 - alpha).
    const double c = std::min(alpha / (1 - alpha), (1 - alpha) / alpha);
    // Z^2 (1 - c^2) = c^2 beta r^2.
    const double ratio = c * std::sqrt(beta / (1 - c * c));
    ExpectRegionEndsAt(model,
                       -ratio / std::sqrt(1 + ratio * ratio),
                       random.Vector(2, 1).normalized());
  }
}

TEST(CameraExtendedUnified, IsTheUnifiedModelForAUnitSphere) {
  RandomValues random(5);
  for (int i = 0; i < kAxialTrials; ++i) {
    const double alpha = random.Uniform(0.01, 0.99);
    const CameraExtendedUnified model(std::array{alpha, 1.0});
    const CameraUnified unified(
        std::array{alpha / (1 - alpha), 0.0, 0.0, 0.0, 0.0});
    const Eigen::Vector3d p_C = 3 * random.Direction();
    Eigen::Vector2d d, u;
    const bool seen = model.Project<double>(kAxialPlane, p_C, &d, nullptr);
    ASSERT_EQ(seen, unified.Project<double>(kAxialPlane, p_C, &u, nullptr));
    if (!seen) continue;
    EXPECT_LT((d - u / (1 - alpha)).norm(), 1e-13 * (1 + d.squaredNorm()));
  }
}

TEST(CameraDoubleSphere, RegionEndsAtTheClosedForm) {
  RandomValues random(6);
  for (int i = 0; i < kAxialTrials; ++i) {
    const double xi = random.Uniform(-0.9, 0.9);
    const double alpha = random.Uniform(0.01, 0.99);
    const CameraDoubleSphere model(std::array{xi, alpha});
    const double c = std::min(alpha / (1 - alpha), (1 - alpha) / alpha);
    const double rest = 1 - c * c;
    const double border = xi * rest + c * std::sqrt(1 - xi * xi * rest);
    ExpectRegionEndsAt(model, -border, random.Vector(2, 1).normalized());
  }
}

TEST(CameraDoubleSphere, IsTheUnifiedModelForConcentricSpheres) {
  RandomValues random(7);
  for (int i = 0; i < kAxialTrials; ++i) {
    const double alpha = random.Uniform(0.01, 0.99);
    const CameraDoubleSphere model(std::array{0.0, alpha});
    const CameraExtendedUnified unified(std::array{alpha, 1.0});
    const Eigen::Vector3d p_C = 3 * random.Direction();
    Eigen::Vector2d d, u;
    const bool seen = model.Project<double>(kAxialPlane, p_C, &d, nullptr);
    ASSERT_EQ(seen, unified.Project<double>(kAxialPlane, p_C, &u, nullptr));
    if (!seen) continue;
    EXPECT_LT((d - u).norm(), 1e-13 * (1 + d.squaredNorm()));
  }
}

TEST(CameraDoubleSphere, RefusesShiftsBeyondTheSphere) {
  for (const double xi : {-1.5, -1.0, 1.0, 1.5}) {
    const CameraDoubleSphere model(std::array{xi, 0.5});
    EXPECT_FALSE(IsValid(model, {0, 0, 1}));
    Eigen::Vector3d ray;
    EXPECT_FALSE(model.Unproject({0, 0}, &ray));
  }
}

}  // namespace
}  // namespace selfcal
