#include "core/model/camera.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <string_view>
#include <unsupported/Eigen/AutoDiff>
#include <vector>

#include "core/model/camera_model.h"
#include "test/core/model/each_model.h"
#include "test/core/model/random_values.h"
#include "test/core/model/rounding.h"
#include "test/core/model/textbook_cameras.h"
#include "test/core/numeric_jacobian.h"

namespace selfcal {
namespace {

constexpr int kCameraTrials = 3000;

// Returns true for a pinhole with a distortion, which sees no ray at 90 degrees
// or beyond.
bool IsPinhole(DistortionModel model) {
  const std::string_view name = DistortionName(model);
  return name == "fov" || name.starts_with("radial-tangential");
}

// The largest angle to which the tests go: 71 degrees for a pinhole, whose
// coordinates u go to infinity, and 178 for others.
double MaxAngle(DistortionModel model) {
  return IsPinhole(model) ? std::atan(3.0) : 3.1;
}

Eigen::Vector3d RayAt(double theta, const Eigen::Vector2d& direction) {
  return (Eigen::Vector3d() << std::sin(theta) * direction, std::cos(theta))
      .finished();
}

bool IsValid(const CameraCalibration& camera, const Eigen::Vector3d& ray_C) {
  Eigen::Vector2d z_px;
  return Project(camera, ray_C, &z_px, nullptr);
}

// Angle from the axis at which the valid region ends in a direction, or
// MaxAngle if it reaches that far.
double BorderAngle(const CameraCalibration& camera,
                   const Eigen::Vector2d& direction) {
  double inside = 0;
  double outside = MaxAngle(camera.model);
  if (IsValid(camera, RayAt(outside, direction))) return outside;
  for (int i = 0; i < 60; ++i) {
    const double middle = (inside + outside) / 2;
    (IsValid(camera, RayAt(middle, direction)) ? inside : outside) = middle;
  }
  return inside;
}

Eigen::Vector2d RandomDirection2(RandomValues* random) {
  const double angle = random->Uniform(0, 6.3);
  return Eigen::Vector2d(std::cos(angle), std::sin(angle));
}

// A random ray up to `part` of the way to the border; every fourth near the
// axis.
Eigen::Vector3d RandomRay(const CameraCalibration& camera,
                          double part,
                          RandomValues* random) {
  const Eigen::Vector2d direction = RandomDirection2(random);
  if (random->Uniform(0, 1) < 0.25) {
    return RayAt(std::abs(random->SignedMagnitude(1e-12, 1e-2)), direction);
  }
  const double border = BorderAngle(camera, direction);
  return RayAt(random->Uniform(0, part) * border, direction);
}

CameraCalibration Moved(const CameraCalibration& camera,
                        const Eigen::VectorXd& intrinsics) {
  CameraCalibration moved = camera;
  moved.f += intrinsics.head<2>();
  moved.c += intrinsics.segment<2>(2);
  moved.distortion += intrinsics.tail(camera.distortion.size());
  return moved;
}

// With f = 1 and c = 0 the differences do not lose digits to large pixels.
CameraCalibration InNormalisedPlane(CameraCalibration camera) {
  camera.f.setOnes();
  camera.c.setZero();
  return camera;
}

void ExpectJacobiansHold(const CameraCalibration& camera,
                         const Eigen::Vector3d& p_C,
                         double step,
                         double tolerance) {
  Eigen::Vector2d z_px;
  ProjectionJacobians jacobians;
  ASSERT_TRUE(Project(camera, p_C, &z_px, &jacobians));
  // Steps relative to the distance, as the pixel does not depend on the scale.
  const double depth = 0.3 * p_C.norm();
  const auto by_point = [&](const Eigen::VectorXd& d) -> Eigen::VectorXd {
    Eigen::Vector2d z;
    EXPECT_TRUE(Project(camera, p_C + depth * d, &z, nullptr));
    return z;
  };
  const auto by_intrinsics = [&](const Eigen::VectorXd& d) -> Eigen::VectorXd {
    Eigen::Vector2d z;
    EXPECT_TRUE(Project(Moved(camera, d), p_C, &z, nullptr));
    return z;
  };
  const Eigen::MatrixXd point = NumericJacobian(by_point, 3, step);
  const Eigen::MatrixXd intrinsics =
      NumericJacobian(by_intrinsics, camera.IntrinsicsSize(), step);
  ASSERT_EQ(jacobians.intrinsics.cols(), camera.IntrinsicsSize());
  EXPECT_LT((depth * jacobians.point - point).norm(),
            tolerance * (1 + point.norm()))
      << "at " << p_C.transpose() << " with " << camera.distortion.transpose();
  EXPECT_LT((jacobians.intrinsics - intrinsics).norm(),
            tolerance * (1 + intrinsics.norm()))
      << "at " << p_C.transpose() << " with " << camera.distortion.transpose();
}

class CameraTest : public testing::TestWithParam<DistortionModel> {};

INSTANTIATE_TEST_SUITE_P(Models,
                         CameraTest,
                         EachCameraModel(),
                         CameraModelName);

TEST_P(CameraTest, WithoutDistortionInTheModelOnTheAxisIsAPinhole) {
  RandomValues random(1);
  for (int i = 0; i < kCameraTrials; ++i) {
    CameraCalibration camera = random.Camera(GetParam());
    const Eigen::Vector2d u = 1e-5 * random.Vector(2, 1);
    Eigen::Vector2d z_px;
    camera.distortion = Undistorted(GetParam());
    ASSERT_TRUE(Project(camera, u.homogeneous(), &z_px, nullptr));
    // The next term of every model is of third order: 1e-15 here.
    EXPECT_LT((z_px - camera.f.cwiseProduct(u) - camera.c).norm(), 1e-12);
  }
}

TEST_P(CameraTest, PixelDoesNotDependOnTheScaleOfThePoint) {
  RandomValues random(2);
  for (int i = 0; i < kCameraTrials; ++i) {
    const CameraCalibration camera = random.Camera(GetParam());
    const Eigen::Vector3d p_C = RandomRay(camera, 0.95, &random);
    const double scale = std::abs(random.SignedMagnitude(1e-9, 1e9));
    Eigen::Vector2d z_px;
    Eigen::Vector2d scaled_z_px;
    ProjectionJacobians jacobians;
    ASSERT_TRUE(Project(camera, p_C, &z_px, &jacobians));
    ASSERT_TRUE(Project(camera, scale * p_C, &scaled_z_px, nullptr));
    // What rounding the point and the pixel may change.
    EXPECT_LT((z_px - scaled_z_px).norm(),
              1e-15 * (z_px.norm() + jacobians.point.norm() * p_C.norm()));
  }
}

TEST_P(CameraTest, JacobiansAreTheDerivativesAroundTheAxis) {
  RandomValues random(3);
  for (int i = 0; i < kCameraTrials; ++i) {
    const CameraCalibration camera =
        InNormalisedPlane(random.Camera(GetParam()));
    const double theta = i % 2 == 0
                             ? std::abs(random.SignedMagnitude(1e-12, 1e-2))
                             : random.Uniform(0, 0.5);
    const double distance = std::abs(random.SignedMagnitude(1e-3, 1e3));
    ExpectJacobiansHold(camera,
                        distance * RayAt(theta, RandomDirection2(&random)),
                        1e-4,
                        1e-10);
  }
}

// Derivatives by the point and by the coefficients.
using Derivatives = Eigen::Matrix<double, 3 + kMaxDistortion, 1>;
using Dual = Eigen::AutoDiffScalar<Derivatives>;

TEST_P(CameraTest, IsTheTextbookFormulaWithItsAutomaticDerivatives) {
  RandomValues random(17);
  int with_border = 0;
  for (int i = 0; i < 2 * kCameraTrials; ++i) {
    const CameraCalibration camera =
        InNormalisedPlane(random.Camera(GetParam()));
    const Eigen::Vector2d direction = RandomDirection2(&random);
    const double border = BorderAngle(camera, direction);
    if (border < MaxAngle(GetParam())) ++with_border;
    const double gap = i % 2 == 0
                           ? random.Uniform(1e-9, 0.999)
                           : std::abs(random.SignedMagnitude(1e-9, 1e-1));
    const double theta = border * (1 - gap);
    const Eigen::Vector3d p_C =
        random.Uniform(0.1, 10) * RayAt(theta, direction);
    Eigen::Matrix<Dual, Eigen::Dynamic, 1, 0, kMaxDistortion, 1> k(
        camera.distortion.size());
    for (int j = 0; j < k.size(); ++j) {
      k[j] = Dual(camera.distortion[j], Derivatives::Unit(3 + j));
    }
    Eigen::Matrix<Dual, 3, 1> p;
    for (int j = 0; j < 3; ++j) p[j] = Dual(p_C[j], Derivatives::Unit(j));
    const Image<Dual> expected =
        TextbookImage<Dual>(GetParam(), k, p[0], p[1], p[2]);
    Eigen::Vector2d d;
    ProjectionJacobians J;
    ASSERT_TRUE(Project(camera, p_C, &d, &J));
    // Rounding the point may change this.
    const double by_ray = J.point.norm() * p_C.norm();
    for (int row = 0; row < 2; ++row) {
      EXPECT_NEAR(d[row], expected[row].value(), 1e-14 * (1 + by_ray));
      const Derivatives& by = expected[row].derivatives();
      EXPECT_LT((J.point.row(row).transpose() - by.head<3>()).norm(),
                1e-11 * by.head<3>().norm() * (1 + by_ray))
          << theta << " with " << camera.distortion.transpose();
      const auto by_k = by.segment(3, k.size());
      EXPECT_LT(
          (J.intrinsics.row(row).tail(k.size()).transpose() - by_k).norm(),
          1e-11 * (0.1 + by_k.norm()) * (1 + by_ray))
          << theta << " with " << camera.distortion.transpose();
    }
  }
  if (GetParam() != DistortionModel::kFov) {
    EXPECT_GT(with_border, 100);
  }
}

TEST_P(CameraTest, JacobiansInPixelsAreThoseOfThePlaneTimesTheFocalLength) {
  RandomValues random(4);
  for (int i = 0; i < kCameraTrials; ++i) {
    const CameraCalibration camera = random.Camera(GetParam());
    const Eigen::Vector3d ray_C = RandomRay(camera, 1 - 1e-9, &random);
    Eigen::Vector2d z_px, d;
    ProjectionJacobians J, plane;
    ASSERT_TRUE(Project(camera, ray_C, &z_px, &J));
    ASSERT_TRUE(Project(InNormalisedPlane(camera), ray_C, &d, &plane));
    ExpectSameFormula(z_px, (d.cwiseProduct(camera.f) + camera.c).eval());
    const Eigen::MatrixXd point = camera.f.asDiagonal() * plane.point;
    EXPECT_LE((J.point - point).norm(), 1e-15 * point.norm());
    Eigen::MatrixXd intrinsics = camera.f.asDiagonal() * plane.intrinsics;
    intrinsics.leftCols<2>() = d.asDiagonal();
    intrinsics.middleCols<2>(2).setIdentity();
    EXPECT_LE((J.intrinsics - intrinsics).norm(), 1e-15 * intrinsics.norm());
  }
}

TEST_P(CameraTest, JacobiansDoNotChangeThePixelOrTheValidity) {
  RandomValues random(6);
  for (int i = 0; i < kCameraTrials; ++i) {
    const CameraCalibration camera = random.Camera(GetParam());
    Eigen::Vector3d p_C = random.Vector(3, 1);
    p_C.z() += 0.6;
    Eigen::Vector2d with(0, 0);
    Eigen::Vector2d without(0, 0);
    ProjectionJacobians jacobians;
    EXPECT_EQ(Project(camera, p_C, &with, &jacobians),
              Project(camera, p_C, &without, nullptr));
    ExpectSameFormula(with, without);
  }
}

TEST_P(CameraTest, UnprojectInvertsProject) {
  RandomValues random(7);
  for (int i = 0; i < kCameraTrials; ++i) {
    const CameraCalibration camera = random.Camera(GetParam());
    const Eigen::Vector3d p_C = RandomRay(camera, 0.95, &random);
    Eigen::Vector2d z_px;
    Eigen::Vector3d bearing_C;
    ASSERT_TRUE(Project(camera, 7 * p_C, &z_px, nullptr));
    ASSERT_TRUE(Unproject(camera, z_px, &bearing_C));
    EXPECT_NEAR(bearing_C.norm(), 1, 1e-15);
    EXPECT_LT((bearing_C - p_C.normalized()).norm(), 1e-11)
        << p_C.transpose() << " with " << camera.distortion.transpose();
  }
}

TEST_P(CameraTest, ProjectInvertsUnprojectUpToTheBorder) {
  RandomValues random(8);
  int checked = 0;
  for (int i = 0; i < kCameraTrials; ++i) {
    const CameraCalibration camera = random.Camera(GetParam());
    const Eigen::Vector2d direction = RandomDirection2(&random);
    const double border = BorderAngle(camera, direction);
    const double gap = std::abs(random.SignedMagnitude(1e-7, 1e-1));
    Eigen::Vector2d z_px;
    Eigen::Vector2d again_px;
    Eigen::Vector3d bearing_C;
    ProjectionJacobians jacobians;
    ASSERT_TRUE(Project(
        camera, RayAt(border * (1 - gap), direction), &z_px, &jacobians));
    // Where coordinates go to infinity, those of an image have ended before.
    if (!((z_px - camera.c).cwiseQuotient(camera.f).norm() < 100)) continue;
    ++checked;
    ASSERT_TRUE(Unproject(camera, z_px, &bearing_C))
        << gap << " with " << camera.distortion.transpose();
    ASSERT_TRUE(Project(camera, bearing_C, &again_px, nullptr));
    // Rounding the ray may change the second part, where coordinates go to
    // infinity.
    EXPECT_LT((z_px - again_px).norm(), 1e-9 + 5e-15 * jacobians.point.norm())
        << gap << " with " << camera.distortion.transpose();
  }
  EXPECT_GT(checked, kCameraTrials * 2 / 3);
}

TEST_P(CameraTest, UnprojectOfAnyPixelIsInvertedOrRefused) {
  RandomValues random(9);
  int unprojected = 0;
  for (int i = 0; i < kCameraTrials; ++i) {
    const CameraCalibration camera = random.Camera(GetParam());
    const Eigen::Vector2d z_px(random.Uniform(-500, 1200),
                               random.Uniform(-500, 1000));
    Eigen::Vector3d bearing_C;
    if (!Unproject(camera, z_px, &bearing_C)) continue;
    ++unprojected;
    Eigen::Vector2d again_px;
    ASSERT_TRUE(Project(camera, bearing_C, &again_px, nullptr));
    EXPECT_LT((z_px - again_px).norm(), 1e-8);
  }
  EXPECT_GT(unprojected, kCameraTrials / 3);
}

TEST(Unproject, RefusesPixelsOfRaysThatProjectRefuses) {
  // The FOV model maps the whole half space into the radius pi / (2 w).
  RandomValues random(15);
  int unprojected = 0;
  int refused = 0;
  for (int i = 0; i < kCameraTrials; ++i) {
    CameraCalibration camera =
        InNormalisedPlane(random.Camera(DistortionModel::kFov));
    camera.distortion[0] = random.Uniform(0.5, 1.3);
    const double edge = std::numbers::pi / 2 / camera.distortion[0];
    const double gap = std::abs(random.SignedMagnitude(1e-10, 1e-3));
    const Eigen::Vector2d z_px = edge * (1 - gap) * RandomDirection2(&random);
    Eigen::Vector3d bearing_C;
    if (Unproject(camera, z_px, &bearing_C)) {
      Eigen::Vector2d again_px;
      EXPECT_TRUE(Project(camera, bearing_C, &again_px, nullptr)) << gap;
      EXPECT_LT((again_px - z_px).norm(), 1e-14);
      ++unprojected;
    } else {
      ++refused;
    }
  }
  EXPECT_GT(unprojected, kCameraTrials / 10);
  EXPECT_GT(refused, kCameraTrials / 10);
}

TEST_P(CameraTest, PointsBehindOrAtTheCameraPlaneAreRefusedOrInverted) {
  RandomValues random(10);
  int seen = 0;
  for (int i = 0; i < kCameraTrials; ++i) {
    const CameraCalibration camera = random.Camera(GetParam());
    Eigen::Vector3d p_C = random.Vector(3, 1);
    p_C.z() = -std::abs(p_C.z());
    if (i % 3 == 0) p_C.z() = 0;
    if (i % 3 == 1) p_C.z() = 1e-8 * p_C.head<2>().norm();
    const Eigen::Vector2d before(1, 2);
    Eigen::Vector2d z_px = before;
    if (Project(camera, p_C, &z_px, nullptr)) {
      ++seen;
      Eigen::Vector3d bearing_C;
      ASSERT_TRUE(Unproject(camera, z_px, &bearing_C)) << p_C.transpose();
      EXPECT_LT((bearing_C - p_C.normalized()).norm(), 1e-6)
          << p_C.transpose() << " with " << camera.distortion.transpose();
    } else {
      EXPECT_EQ(z_px, before);
    }
  }
  if (IsPinhole(GetParam())) {
    EXPECT_EQ(seen, 0);
  } else {
    EXPECT_GT(seen, kCameraTrials / 10);
  }
}

TEST_P(CameraTest, BackwardAxisIsRefused) {
  RandomValues random(16);
  for (int i = 0; i < kCameraTrials; ++i) {
    Eigen::Vector2d z_px;
    EXPECT_FALSE(Project(
        random.Camera(GetParam()),
        -std::abs(random.SignedMagnitude(1e-9, 1e9)) * Eigen::Vector3d::UnitZ(),
        &z_px,
        nullptr));
  }
}

const std::vector<double>& ExtremeNumbers() {
  using Limits = std::numeric_limits<double>;
  static const std::vector<double> numbers = {0.0,
                                              Limits::denorm_min(),
                                              1e-310,
                                              Limits::min(),
                                              1e-160,
                                              1e-12,
                                              1.0,
                                              1e12,
                                              1e160,
                                              1e300,
                                              Limits::max(),
                                              Limits::infinity(),
                                              Limits::quiet_NaN()};
  return numbers;
}

TEST_P(CameraTest, ExtremePointsNeverGiveWhatIsNotFinite) {
  RandomValues random(11);
  for (const double x : ExtremeNumbers()) {
    for (const double y : ExtremeNumbers()) {
      for (const double z : ExtremeNumbers()) {
        const CameraCalibration camera = random.Camera(GetParam());
        Eigen::Vector2d z_px;
        ProjectionJacobians jacobians;
        const Eigen::Vector3d p_C(random.Uniform(-1, 1) < 0 ? -x : x,
                                  y,
                                  random.Uniform(-1, 1) < 0 ? -z : z);
        if (!Project(camera, p_C, &z_px, &jacobians)) continue;
        EXPECT_TRUE(z_px.allFinite()) << p_C.transpose();
        EXPECT_TRUE(jacobians.point.allFinite()) << p_C.transpose();
        EXPECT_TRUE(jacobians.intrinsics.allFinite()) << p_C.transpose();
      }
    }
  }
}

TEST_P(CameraTest, ExtremeParametersNeverGiveWhatIsNotFinite) {
  RandomValues random(12);
  for (int i = 0; i < 200; ++i) {
    for (const double number : ExtremeNumbers()) {
      CameraCalibration camera = random.Camera(GetParam());
      const int which =
          static_cast<int>(random.Uniform(0, camera.IntrinsicsSize()));
      const double value = random.Uniform(-1, 1) < 0 ? -number : number;
      if (which < 2) camera.f[which] = value;
      if (which >= 2 && which < 4) camera.c[which - 2] = value;
      if (which >= 4) camera.distortion[which - 4] = value;
      Eigen::Vector2d z_px;
      ProjectionJacobians jacobians;
      if (Project(camera, Eigen::Vector3d(0.3, -0.2, 1), &z_px, &jacobians)) {
        EXPECT_TRUE(z_px.allFinite());
        EXPECT_TRUE(jacobians.point.allFinite());
        EXPECT_TRUE(jacobians.intrinsics.allFinite());
      }
      Eigen::Vector3d bearing_C;
      if (Unproject(camera, Eigen::Vector2d(100, 200), &bearing_C)) {
        EXPECT_TRUE(bearing_C.allFinite());
      }
    }
  }
}

TEST_P(CameraTest, ExtremePixelsNeverGiveWhatIsNotFinite) {
  RandomValues random(13);
  for (const double x : ExtremeNumbers()) {
    for (const double y : ExtremeNumbers()) {
      const CameraCalibration camera = random.Camera(GetParam());
      const Eigen::Vector3d before(3, 4, 5);
      Eigen::Vector3d bearing_C = before;
      if (Unproject(camera, Eigen::Vector2d(x, -y), &bearing_C)) {
        EXPECT_TRUE(bearing_C.allFinite());
        EXPECT_NEAR(bearing_C.norm(), 1, 1e-15);
      } else {
        EXPECT_EQ(bearing_C, before);
      }
    }
  }
}

TEST_P(CameraTest, ExtendsTheModelsWithWhoseCoefficientsItsOwnBegin) {
  RandomValues random(18);
  const auto all = ModelInfo(GetParam()).coefficients;
  for (const DistortionModel other : DistortionModels()) {
    const auto first = ModelInfo(other).coefficients;
    if (first.size() >= all.size() ||
        !std::equal(
            first.begin(),
            first.end(),
            all.begin(),
            [](const auto& a, const auto& b) { return a.name == b.name; })) {
      continue;
    }
    for (int i = 0; i < kCameraTrials; ++i) {
      const CameraCalibration camera = random.Camera(other);
      CameraCalibration extended = camera;
      extended.model = GetParam();
      extended.distortion = Undistorted(GetParam());
      extended.distortion.head(camera.distortion.size()) = camera.distortion;
      const Eigen::Vector3d p_C = random.Direction();
      Eigen::Vector2d z_px, extended_px;
      const bool seen = Project(camera, p_C, &z_px, nullptr);
      ASSERT_EQ(seen, Project(extended, p_C, &extended_px, nullptr));
      if (!seen) continue;
      EXPECT_LT((z_px - extended_px).norm(), 1e-14 * (1 + z_px.norm()));
    }
  }
}

TEST_P(CameraTest, WrongNumberOfCoefficientsIsRefused) {
  RandomValues random(14);
  CameraCalibration camera = random.Camera(GetParam());
  camera.distortion.setZero(DistortionSize(GetParam()) - 1);
  Eigen::Vector2d z_px;
  Eigen::Vector3d bearing_C;
  EXPECT_FALSE(Project(camera, Eigen::Vector3d::UnitZ(), &z_px, nullptr));
  EXPECT_FALSE(Unproject(camera, camera.c, &bearing_C));
}

}  // namespace
}  // namespace selfcal
