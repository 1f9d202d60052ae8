#include "client/tracking/patch_plane.h"

#include <Eigen/LU>
#include <cmath>

namespace selfcal::client {
namespace {

// Standard deviation of an element of a warp, over that of the slope of a
// surface: a change of the distance along the parallax is trusted where the
// parallax [rad] is larger.
constexpr double kLeastParallax_rad = 0.015;

// The map of the plane x of the first image to that of the second, whose axes
// are rotated to it by R, is
//   p = R (x, 1) + rho (1 + g^T x) t,   u = (p_x, p_y) / p_z,
// for a flat surface of inverse distance rho (1 + g^T x) and a translation t.
// The middle of both planes is the same point: rho (t_x, t_y) = -e with the
// parallax e = (R_13, R_23), and s = R_33 + rho t_z is the ratio of distances.
// Then
//   u = s A x / (s + q^T x),   s A = R_2x2 - e g^T,
//   q = (R_31, R_32)^T + (s - R_33) g.
// Across e, the second line gives s, and along e it gives g. Returns q / s, of
// the second order u = A x - A x (q / s)^T x.
std::optional<Eigen::Vector2d> Perspective(const Eigen::Matrix3d& R,
                                           const Eigen::Matrix2d& A) {
  const Eigen::Vector2d e = R.topRightCorner<2, 1>();
  const Eigen::Matrix2d R2 = R.topLeftCorner<2, 2>();
  const Eigen::Vector2d across = e.norm() > 0
                                     ? Eigen::Vector2d(-e.y(), e.x()) / e.norm()
                                     : Eigen::Vector2d(1, 0);
  const Eigen::RowVector2d of_A = across.transpose() * A;
  const Eigen::RowVector2d of_R = across.transpose() * R2;
  const double s = of_R.dot(of_A) / of_A.squaredNorm();
  if (!(s > 0)) return std::nullopt;
  const Eigen::Vector2d g =
      -(s * A - R2).transpose() * e /
      (e.squaredNorm() + kLeastParallax_rad * kLeastParallax_rad);
  return (R.bottomLeftCorner<1, 2>().transpose() + (s - R(2, 2)) * g) / s;
}

}  // namespace

PatchPlane PlaneAt(const CameraCalibration& camera,
                   const Eigen::Vector2d& z_px,
                   const std::optional<Eigen::Quaterniond>& q_GC) {
  PatchPlane plane;
  plane.curvature = CurvatureAt(camera, z_px);
  Eigen::Vector3d axis;
  Eigen::Vector2d again_px;
  ProjectionJacobians J;
  if (!q_GC || !Unproject(camera, z_px, &axis) ||
      !Project(camera, axis, &again_px, &J)) {
    return plane;
  }
  Eigen::Matrix3d axes_C;
  const Eigen::Vector3d first = axis.unitOrthogonal();
  axes_C << first, axis.cross(first), axis;
  plane.by_pixel = (J.point * axes_C.leftCols<2>()).inverse();
  if (plane.by_pixel.allFinite()) {
    plane.axes_G = q_GC->toRotationMatrix() * axes_C;
  }
  return plane;
}

LensCurvature SecondOrderOfWarp(const PatchPlane& from,
                                const Eigen::Matrix2d& A,
                                const PatchPlane& to) {
  LensCurvature order = CurvatureOfWarp(from.curvature, A, to.curvature);
  if (!from.axes_G || !to.axes_G) return order;
  const auto q = Perspective(to.axes_G->transpose() * *from.axes_G,
                             to.by_pixel * A * from.by_pixel.inverse());
  if (!q) return order;
  const Eigen::Vector2d k = from.by_pixel.transpose() * *q;
  order.col(0) -= k.x() * A.col(0);
  order.col(1) -= k.y() * A.col(0) + k.x() * A.col(1);
  order.col(2) -= k.y() * A.col(1);
  return order;
}

}  // namespace selfcal::client
