// The rational radial-tangential model of OpenCV, k1 k2 p1 p2 k3 k4 k5 k6 in
// its order: the factor L = (1 + k1 q + k2 q^2 + k3 q^3) / (1 + k4 q + k5 q^2 +
// k6 q^3), q = r^2, in radial_tangential.h, which has the mathematics. Source:
// Claus and Fitzgibbon, "A rational function lens distortion model for general
// cameras" (2005), and OpenCV's documentation of its module calib3d.
#pragma once

#include <string_view>

#include "core/model/camera_model.h"
#include "core/model/radial_tangential.h"

namespace selfcal {

class DistortionRadialTangential8 : public RadialTangential<RadialRational> {
  // Numerator and denominator of calibrated lenses nearly cancel, with values
  // up to some hundreds.
  static constexpr Interval kValid = {-1e4, 1e4};
  static constexpr Interval kTangential = {-2e-3, 2e-3};

 public:
  static constexpr std::string_view kName = "radial-tangential-8";
  // sigma_ref is chosen, not measured: the value that moves a point at the edge
  // of a typical image by about 1.5 px. These sigmas shift every entropy of a
  // group by one constant and do not affect the ranking. The usual values
  // distort as much as those of real lenses do, where k1 k2 k3 and k4 k5 k6
  // are larger and depend on each other.
  static constexpr CameraCoefficient kCoefficients[] = {
      {.name = "k1", .sigma_ref = 5e-3, .valid = kValid, .usual = {-0.2, 0.3}},
      {.name = "k2", .sigma_ref = 5e-3, .valid = kValid, .usual = {-0.1, 0.1}},
      {.name = "p1", .sigma_ref = 5e-4, .valid = kValid, .usual = kTangential},
      {.name = "p2", .sigma_ref = 5e-4, .valid = kValid, .usual = kTangential},
      {.name = "k3",
       .sigma_ref = 5e-3,
       .valid = kValid,
       .usual = {-0.02, 0.05}},
      {.name = "k4", .sigma_ref = 5e-3, .valid = kValid, .usual = {-0.1, 0.4}},
      {.name = "k5", .sigma_ref = 5e-3, .valid = kValid, .usual = {-0.05, 0.1}},
      {.name = "k6",
       .sigma_ref = 5e-3,
       .valid = kValid,
       .usual = {-0.01, 0.05}}};
  static constexpr ToolModel kTools[] = {
      {.tool = "vins_fusion",
       .name = "PINHOLE_FULL",
       .coefficients = "distortion_parameters.k1 distortion_parameters.k2 "
                       "distortion_parameters.p1 distortion_parameters.p2 "
                       "distortion_parameters.k3 distortion_parameters.k4 "
                       "distortion_parameters.k5 distortion_parameters.k6",
       .pixels = "projection_parameters.fx projection_parameters.fy "
                 "projection_parameters.cx projection_parameters.cy"},
      {.tool = "basalt",
       .name = "pinhole-radtan8",
       .coefficients = "k1 k2 p1 p2 k3 k4 k5 k6"},
      {.tool = "camera_info", .name = "rational_polynomial"}};

  using RadialTangential::RadialTangential;
};

}  // namespace selfcal
