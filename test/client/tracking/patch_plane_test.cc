#include "client/tracking/patch_plane.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <random>

#include "core/model/so3.h"
#include "test/client/tracking/second_powers.h"
#include "test/core/simulation/rigs.h"

namespace selfcal::client {
namespace {

// A flat surface n^T p = 1 in the frame of the first camera, and the camera
// moved by p_2 = q p_1 + t.
struct View {
  CameraCalibration camera;
  Eigen::Vector3d n;
  Eigen::Quaterniond q;
  Eigen::Vector3d t;

  // The pixel at which the second camera sees what the first one sees at z_px.
  std::optional<Eigen::Vector2d> Moved(const Eigen::Vector2d& z_px) const {
    Eigen::Vector3d ray;
    Eigen::Vector2d moved_px;
    if (!Unproject(camera, z_px, &ray) || !(n.dot(ray) > 0.1) ||
        !Project(camera, q * (ray / n.dot(ray)) + t, &moved_px, nullptr)) {
      return std::nullopt;
    }
    return moved_px;
  }
};

// Mean displacement over a patch that a second order leaves [px].
Eigen::Vector2d MeanLeft(const View& view,
                         const Eigen::Vector2d& z,
                         const Eigen::Vector2d& to,
                         const Eigen::Matrix2d& A,
                         const LensCurvature& order) {
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  constexpr int kPoints = 16;
  for (int i = 0; i < kPoints; ++i) {
    const double angle = 2 * M_PI * i / kPoints;
    const Eigen::Vector2d x =
        6 * Eigen::Vector2d(std::cos(angle), std::sin(angle));
    sum += *view.Moved(z + x) - to - A * x - order * SecondPowers(x);
  }
  return sum / kPoints;
}

// Walls of any slant up to 50 degrees, at any distance; motions of up to a
// third of the distance, and rotations.
TEST(SecondOrderOfWarp, IsThatOfAFlatSurfaceOfAnySlant) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> unit(-1, 1);
  for (const DistortionModel model : DistortionModels()) {
    SCOPED_TRACE(DistortionName(model));
    double of_lens = 0, of_all = 0;
    int views = 0;
    for (int trial = 0; trial < 200; ++trial) {
      View view;
      view.camera = LensRig(model).factory.cameras[0];
      const Eigen::Vector2d z(320 + 80 * unit(random), 320 + 80 * unit(random));
      Eigen::Vector3d ray;
      ASSERT_TRUE(Unproject(view.camera, z, &ray));
      const double distance = 2 + unit(random);
      const Eigen::Vector3d normal =
          (ray +
           0.7 * Eigen::Vector3d(unit(random), unit(random), unit(random)))
              .normalized();
      view.n = normal / (distance * normal.dot(ray));
      view.q =
          Exp(0.3 * Eigen::Vector3d(unit(random), unit(random), unit(random)));
      view.t = distance / 3 *
               Eigen::Vector3d(unit(random), unit(random), unit(random));
      const auto to = view.Moved(z);
      if (!to || !view.Moved(z + Eigen::Vector2d(8, 8)) ||
          !view.Moved(z - Eigen::Vector2d(8, 8)) ||
          !view.Moved(z + Eigen::Vector2d(8, -8)) ||
          !view.Moved(z - Eigen::Vector2d(8, -8))) {
        continue;
      }
      ++views;
      Eigen::Matrix2d A;
      for (int axis = 0; axis < 2; ++axis) {
        const Eigen::Vector2d step = 0.1 * Eigen::Vector2d::Unit(axis);
        A.col(axis) = (*view.Moved(z + step) - *view.Moved(z - step)) / 0.2;
      }
      // The first camera is the frame that does not rotate.
      const PatchPlane from =
          PlaneAt(view.camera, z, Eigen::Quaterniond::Identity());
      const PatchPlane plane = PlaneAt(view.camera, *to, view.q.conjugate());
      const Eigen::Vector2d left =
          MeanLeft(view, z, *to, A, SecondOrderOfWarp(from, A, plane));
      const Eigen::Vector2d lens =
          MeanLeft(view,
                   z,
                   *to,
                   A,
                   SecondOrderOfWarp(PlaneAt(view.camera, z, std::nullopt),
                                     A,
                                     PlaneAt(view.camera, *to, std::nullopt)));
      of_all += left.squaredNorm();
      of_lens += lens.squaredNorm();
    }
    ASSERT_GT(views, 100);
    std::printf("%d views: %.4f px left, %.4f px of the lens alone\n",
                views,
                std::sqrt(of_all / views),
                std::sqrt(of_lens / views));
    // The fourth order is left, and what small parallaxes do not show.
    EXPECT_LT(of_all, 0.01 * of_lens);
  }
}

// A rotation alone has no perspective beyond that of the lens.
TEST(SecondOrderOfWarp, OfARotationIsThatOfTheLens) {
  for (const DistortionModel model : DistortionModels()) {
    const CameraCalibration camera = LensRig(model).factory.cameras[0];
    const Eigen::Quaterniond q = Exp({0.1, -0.15, 0.2});
    const Eigen::Vector2d z(300, 350);
    const View view{camera, {0.1, 0.2, 0.6}, q, Eigen::Vector3d::Zero()};
    const auto to = view.Moved(z);
    ASSERT_TRUE(to);
    Eigen::Matrix2d A;
    for (int axis = 0; axis < 2; ++axis) {
      const Eigen::Vector2d step = 0.1 * Eigen::Vector2d::Unit(axis);
      A.col(axis) = (*view.Moved(z + step) - *view.Moved(z - step)) / 0.2;
    }
    const PatchPlane from = PlaneAt(camera, z, Eigen::Quaterniond::Identity());
    const PatchPlane plane = PlaneAt(camera, *to, q.conjugate());
    const LensCurvature lens =
        CurvatureOfWarp(from.curvature, A, plane.curvature);
    EXPECT_LT((SecondOrderOfWarp(from, A, plane) - lens).norm(),
              1e-6 * (1 + lens.norm()))
        << DistortionName(model);
  }
}

}  // namespace
}  // namespace selfcal::client
