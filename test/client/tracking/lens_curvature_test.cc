#include "client/tracking/lens_curvature.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "core/model/so3.h"
#include "test/client/tracking/second_powers.h"
#include "test/core/simulation/rigs.h"

namespace selfcal::client {
namespace {

// The pixel to which a rotation of the camera takes another.
std::optional<Eigen::Vector2d> Turned(const CameraCalibration& camera,
                                      const Eigen::Quaterniond& q,
                                      const Eigen::Vector2d& z_px) {
  Eigen::Vector3d ray;
  Eigen::Vector2d turned_px;
  if (!Unproject(camera, z_px, &ray) ||
      !Project(camera, q * ray, &turned_px, nullptr)) {
    return std::nullopt;
  }
  return turned_px;
}

TEST(CurvatureOfWarp, PredictsWhereARotationTakesAPatch) {
  for (const DistortionModel model : DistortionModels()) {
    SCOPED_TRACE(DistortionName(model));
    const CameraCalibration camera = LensRig(model).factory.cameras[0];
    const Eigen::Quaterniond q = Exp({0.25, -0.3, 0.4});
    double affine_px = 0, bent_px = 0;
    for (const Eigen::Vector2d& z : {Eigen::Vector2d(320, 320),
                                     Eigen::Vector2d(250, 380),
                                     Eigen::Vector2d(400, 300)}) {
      const auto to = Turned(camera, q, z);
      ASSERT_TRUE(to);
      Eigen::Matrix2d A;
      for (int axis = 0; axis < 2; ++axis) {
        const Eigen::Vector2d step = 0.1 * Eigen::Vector2d::Unit(axis);
        A.col(axis) =
            (*Turned(camera, q, z + step) - *Turned(camera, q, z - step)) / 0.2;
      }
      const LensCurvature bend =
          CurvatureOfWarp(CurvatureAt(camera, z), A, CurvatureAt(camera, *to));
      for (int i = 0; i < 16; ++i) {
        const Eigen::Vector2d x =
            8 * Eigen::Vector2d(std::cos(0.4 * i), std::sin(0.4 * i));
        const Eigen::Vector2d true_px = *Turned(camera, q, z + x);
        affine_px = std::max(affine_px, (*to + A * x - true_px).norm());
        bent_px = std::max(
            bent_px, (*to + A * x + bend * SecondPowers(x) - true_px).norm());
      }
    }
    // The third order is left.
    EXPECT_LT(bent_px, 0.012);
    EXPECT_GT(affine_px, 3 * bent_px);
  }
}

TEST(CurvatureAt, IsZeroWithoutALensAndWithoutRays) {
  CameraCalibration pinhole = StereoRig().factory.cameras[0];
  pinhole.distortion.setZero();
  EXPECT_LT(CurvatureAt(pinhole, pinhole.c).norm(), 1e-9);
  // A corner beyond the last ray.
  CameraCalibration fisheye =
      LensRig(DistortionModel::kEquidistant).factory.cameras[0];
  fisheye.f *= 0.2;
  EXPECT_EQ(CurvatureAt(fisheye, {0, 0}), LensCurvature::Zero());
}

}  // namespace
}  // namespace selfcal::client
