// The camera models as their papers write them, for comparison: with angles and
// radii, without regard to the axis or to the region of validity. The scalar
// may be one of automatic differentiation.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <string>

#include "core/model/camera.h"

namespace selfcal {

template <typename T>
using Image = Eigen::Matrix<T, 2, 1>;

// OpenCV's model with 8 coefficients; those that are missing are zero.
template <typename T>
Image<T> TextbookRadialTangential(const T& x,
                                  const T& y,
                                  const Eigen::Matrix<T, 8, 1>& k) {
  const T r2 = x * x + y * y;
  const T r4 = r2 * r2;
  const T r6 = r4 * r2;
  const T radial = (1. + k[0] * r2 + k[1] * r4 + k[4] * r6) /
                   (1. + k[5] * r2 + k[6] * r4 + k[7] * r6);
  return {x * radial + 2. * k[2] * x * y + k[3] * (r2 + 2. * x * x),
          y * radial + k[2] * (r2 + 2. * y * y) + 2. * k[3] * x * y};
}

// The coordinates d of the point (X, Y, Z); k are the coefficients.
template <typename T>
Image<T> TextbookImage(
    DistortionModel model,
    const Eigen::Matrix<T, Eigen::Dynamic, 1, 0, kMaxDistortion, 1>& k,
    const T& X,
    const T& Y,
    const T& Z) {
  using std::atan2;
  using std::sqrt;
  using std::tan;
  const std::string name(DistortionName(model));
  const T r = sqrt(X * X + Y * Y);
  const T R = sqrt(X * X + Y * Y + Z * Z);
  Eigen::Matrix<T, 8, 1> radtan = Eigen::Matrix<T, 8, 1>::Constant(T(0));
  if (name == "fov") {
    const T r_d = atan2(T(2. * r / Z * tan(T(k[0] / 2.))), T(1)) / k[0];
    return {r_d * X / r, r_d * Y / r};
  }
  if (name.starts_with("radial-tangential")) {
    radtan.head(k.size()) = k;
    return TextbookRadialTangential<T>(X / Z, Y / Z, radtan);
  }
  if (name == "equidistant") {
    const T theta = atan2(r, Z);
    const T t2 = theta * theta;
    const T theta_d = theta + theta * t2 * k[0] + theta * t2 * t2 * k[1] +
                      theta * t2 * t2 * t2 * k[2] +
                      theta * t2 * t2 * t2 * t2 * k[3];
    return {theta_d * X / r, theta_d * Y / r};
  }
  if (name == "unified") {
    radtan.head(4) = k.tail(4);
    const T below = Z / R + k[0];
    return TextbookRadialTangential<T>(X / R / below, Y / R / below, radtan);
  }
  if (name == "extended-unified") {
    const T below =
        k[0] * sqrt(k[1] * (X * X + Y * Y) + Z * Z) + (1. - k[0]) * Z;
    return {X / below, Y / below};
  }
  if (name == "double-sphere") {
    const T shifted = k[0] * R + Z;
    const T below =
        k[1] * sqrt(X * X + Y * Y + shifted * shifted) + (1. - k[1]) * shifted;
    return {X / below, Y / below};
  }
  return {T(NAN), T(NAN)};  // of no registered model
}

}  // namespace selfcal
