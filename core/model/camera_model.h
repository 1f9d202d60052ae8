// What a camera model declares, and the parts that models have in common.
// camera_models.h lists the models and the steps to add one.
//
// A model is a class with the static members
//   kName, kCoefficients, kTools   see CameraModelInfo; kSize coefficients,
// that is constructed from the values of its coefficients and has, with the
// signatures of pinhole.h,
//   Project    a template over the scalar (double or Lanes): the pixel of
//              p_C at any positive scale, its ProjectionParts unless null, and
//              whether p_C is where the model is one-to-one,
//   Unproject  a ray in C, of any length, of the coordinates d = (z - c) / f,
//              and whether there is one.
// A model whose coefficients begin with those of another one extends it: with
// the values `undistorted` of the further ones it is the other model. Its
// coefficients need not be those of a distortion. Internal to the project:
// not an installed header.
#pragma once

#include <Eigen/Core>
#include <span>
#include <string_view>

#include "core/model/camera.h"

namespace selfcal {

struct Interval {
  double low;
  double high;
};

// A coefficient of a model. Coefficients are shown without a unit.
struct CameraCoefficient {
  std::string_view name;  // "k1": the component is cam0.distortion.k1
  // Expected standard deviation after one reference segment: see
  // TangentComponent.
  double sigma_ref;
  Interval valid;          // values strictly inside are accepted
  Interval usual;          // values of real lenses, and somewhat beyond
  double undistorted = 0;  // value for a lens without distortion
};

// A model in the files of another tool. Lists are separated by spaces. A model
// may be in a tool under several names: files are written under the first one.
struct ToolModel {
  std::string_view tool;  // "kalibr"; "openvins", ...
  std::string_view name;  // of the model or, with `distortion`, the projection
  std::string_view distortion = {};
  // Names of the coefficients, where the tool names them; a path has dots.
  std::string_view coefficients = {};
  // Further coefficients of the tool's model, which are zero.
  std::string_view zeros = {};
  std::string_view pixels = "fx fy cx cy";  // names of f and c
  // Number of coefficients that precede f and c in a list of intrinsics; the
  // others are in the list of the distortion.
  int before_pixels = 0;
};

struct CameraModelInfo {
  std::string_view name;  // "radial-tangential"
  std::span<const CameraCoefficient> coefficients;
  std::span<const ToolModel> tools;  // tools that have the model
};

// All registered models.
std::span<const DistortionModel> DistortionModels();

const CameraModelInfo& ModelInfo(DistortionModel model);

// Coefficients of a lens without distortion.
DistortionVector Undistorted(DistortionModel model);

// Focal lengths and principal point as plain numbers: z = f d + c, where d are
// the coordinates to which a model maps a point.
struct PixelMap {
  double f[2];
  double c[2];
};
inline PixelMap PixelMapOf(const CameraCalibration& camera) {
  return {{camera.f.x(), camera.f.y()}, {camera.c.x(), camera.c.y()}};
}

// Parts of the derivatives of a pixel z = f d + c. The derivative with respect
// to f is diagonal with d; the one with respect to c is the identity.
template <typename T, int kSize>
struct ProjectionParts {
  Eigen::Matrix<T, 2, 1> d;
  Eigen::Matrix<T, 2, 3> point;           // dz / dp_C
  Eigen::Matrix<T, 2, kSize> distortion;  // dz / d coefficients
};

// Distances between these bounds cannot cause overflow in a projection or its
// derivatives; no physical distance is outside, in any unit.
inline constexpr double kMinDepth = 1e-100;
inline constexpr double kMaxDepth = 1e100;

}  // namespace selfcal
