#include "client/tracking/lens_curvature.h"

#include <Eigen/Geometry>
#include <Eigen/LU>

namespace selfcal::client {
namespace {

constexpr double kStep_px = 4;

}  // namespace

LensCurvature CurvatureAt(const CameraCalibration& camera,
                          const Eigen::Vector2d& z_px) {
  Eigen::Vector3d axis;
  if (!Unproject(camera, z_px, &axis)) return LensCurvature::Zero();
  const Eigen::Vector3d first = axis.unitOrthogonal();
  const Eigen::Vector3d second = axis.cross(first);
  // The places at which the rays of the neighbours meet the plane.
  Eigen::Vector2d u[3][3];
  for (int i = -1; i <= 1; ++i) {
    for (int j = -1; j <= 1; ++j) {
      Eigen::Vector3d ray;
      if (!Unproject(camera, z_px + kStep_px * Eigen::Vector2d(i, j), &ray)) {
        return LensCurvature::Zero();
      }
      u[i + 1][j + 1] =
          Eigen::Vector2d(first.dot(ray), second.dot(ray)) / axis.dot(ray);
    }
  }
  Eigen::Matrix2d J;
  J << (u[2][1] - u[0][1]) / (2 * kStep_px),
      (u[1][2] - u[1][0]) / (2 * kStep_px);
  constexpr double kSquare = kStep_px * kStep_px;
  LensCurvature Q;
  Q << (u[2][1] - 2 * u[1][1] + u[0][1]) / (2 * kSquare),
      (u[2][2] - u[2][0] - u[0][2] + u[0][0]) / (4 * kSquare),
      (u[1][2] - 2 * u[1][1] + u[1][0]) / (2 * kSquare);
  const LensCurvature C = J.inverse() * Q;
  return C.allFinite() ? C : LensCurvature::Zero();
}

// The planes of both places are mapped by an affine map: with d = A x to first
// order, d + C_to(d) = A (x + C_from(x)).
LensCurvature CurvatureOfWarp(const LensCurvature& from,
                              const Eigen::Matrix2d& A,
                              const LensCurvature& to) {
  const double a = A(0, 0), b = A(0, 1), c = A(1, 0), d = A(1, 1);
  Eigen::Matrix3d squares;             // of A x, from those of x
  squares << a * a, 2 * a * b, b * b,  //
      a * c, a * d + b * c, b * d,     //
      c * c, 2 * c * d, d * d;
  return A * from - to * squares;
}

}  // namespace selfcal::client
