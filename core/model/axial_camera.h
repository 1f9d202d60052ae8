// Whole cameras that divide by a distance along the axis: a point p_C = (X, Y,
// Z) has the coordinates
//
//   d = (X, Y) / w,
//
// where w depends on X^2 + Y^2, on Z and on the coefficients. With its
// derivatives in the form dw/dp_C = (a X, a Y, b),
//
//   dd/dp_C = ( [I 0] - d (a X, a Y, b) ) / w,   dd/dk = -d dw/dk / w.
//
// A pinhole has w = Z. Nothing here asks for Z > 0.
#pragma once

#include <Eigen/Core>
#include <span>
#include <string_view>

#include "core/model/camera_model.h"
#include "core/simd/lanes.h"

namespace selfcal {

// w and its derivatives; a and b as above.
template <typename T, int kSize>
struct AxialDistance {
  T w;
  T a;
  T b;
  Eigen::Matrix<T, 1, kSize> by_coefficients;
};

// Squares of distances that cannot cause overflow; false for NaN.
template <typename T>
auto UsableSquare(const T& squared_distance) {
  return squared_distance >= T(kMinDepth * kMinDepth) &&
         squared_distance <= T(kMaxDepth * kMaxDepth);
}

// The smallest w, relative to the distance of the point: where w tends to zero,
// d tends to infinity.
inline constexpr double kMinAxialRatio = 1e-6;

// Derivatives of d = (X, Y) / w; `inverse` is 1 / w.
template <typename T, int kSize>
void DifferentiateQuotient(const Eigen::Matrix<T, 3, 1>& p_C,
                           const AxialDistance<T, kSize>& axial,
                           const Eigen::Matrix<T, 2, 1>& d,
                           const T& inverse,
                           Eigen::Matrix<T, 2, 3>* by_point,
                           Eigen::Matrix<T, 2, kSize>* by_coefficients) {
  const Eigen::Matrix<T, 2, 1> ratio(inverse * d[0], inverse * d[1]);
  const T a_x = axial.a * p_C[0];
  const T a_y = axial.a * p_C[1];
  for (int i = 0; i < 2; ++i) {
    (*by_point)(i, 0) = -ratio[i] * a_x;
    (*by_point)(i, 1) = -ratio[i] * a_y;
    (*by_point)(i, 2) = -ratio[i] * axial.b;
    (*by_point)(i, i) += inverse;
    for (int j = 0; j < kSize; ++j) {
      (*by_coefficients)(i, j) = -ratio[i] * axial.by_coefficients[j];
    }
  }
}

// The pixel of d; scales the derivatives of d in *parts, unless null, to those
// of the pixel.
template <typename T, int kSize>
void ToPixel(const PixelMap& pixels,
             const Eigen::Matrix<T, 2, 1>& d,
             Eigen::Matrix<T, 2, 1>* z_px,
             ProjectionParts<T, kSize>* parts) {
  for (int i = 0; i < 2; ++i) {
    const T f(pixels.f[i]);
    (*z_px)[i] = f * d[i] + pixels.c[i];
    if (parts == nullptr) continue;
    parts->d[i] = d[i];
    for (int j = 0; j < 3; ++j) parts->point(i, j) *= f;
    for (int j = 0; j < kSize; ++j) parts->distortion(i, j) *= f;
  }
}

// A camera model from a class `Axis` that declares what a model declares, and
// has
//   Evaluate  a template over the scalar: w of a point with its derivatives,
//             and whether the model is one-to-one there,
//   Ray       a ray, of any length, of the coordinates d. Where there is none,
//             Evaluate refuses it.
template <class Axis>
class AxialCamera {
 public:
  static constexpr int kSize = Axis::kSize;
  static constexpr std::string_view kName = Axis::kName;
  static constexpr std::span<const CameraCoefficient> kCoefficients =
      Axis::kCoefficients;
  static constexpr std::span<const ToolModel> kTools = Axis::kTools;

  explicit AxialCamera(std::span<const double, kSize> coefficients)
      : axis_(coefficients) {}

  template <typename T>
  auto Project(const PixelMap& pixels,
               const Eigen::Matrix<T, 3, 1>& p_C,
               Eigen::Matrix<T, 2, 1>* z_px,
               ProjectionParts<T, kSize>* parts) const {
    AxialDistance<T, kSize> axial;
    const auto valid = axis_.template Evaluate<T>(p_C, &axial);
    const T inverse = 1.0 / Select(valid, axial.w, T(1));
    const Eigen::Matrix<T, 2, 1> d(inverse * p_C[0], inverse * p_C[1]);
    if (parts != nullptr) {
      DifferentiateQuotient<T, kSize>(
          p_C, axial, d, inverse, &parts->point, &parts->distortion);
    }
    ToPixel<T, kSize>(pixels, d, z_px, parts);
    return valid;
  }

  bool Unproject(const Eigen::Vector2d& d, Eigen::Vector3d* ray_C) const {
    const Eigen::Vector3d ray = axis_.Ray(d);
    AxialDistance<double, kSize> axial;
    if (!axis_.template Evaluate<double>(ray, &axial)) return false;
    *ray_C = ray;
    return true;
  }

 private:
  Axis axis_;
};

}  // namespace selfcal
