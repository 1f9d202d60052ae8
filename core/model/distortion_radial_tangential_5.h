// The radial-tangential model with three radial coefficients, k1 k2 p1 p2 k3 in
// the order of OpenCV: the factor L = 1 + k1 r^2 + k2 r^4 + k3 r^6 in
// radial_tangential.h, which has the mathematics.
#pragma once

#include <string_view>

#include "core/model/camera_model.h"
#include "core/model/radial_tangential.h"

namespace selfcal {

class DistortionRadialTangential5
    : public RadialTangential<RadialPolynomial<3>> {
  static constexpr Interval kValid = {-1e3, 1e3};
  static constexpr Interval kTangential = {-2e-3, 2e-3};

 public:
  static constexpr std::string_view kName = "radial-tangential-5";
  // sigma_ref is chosen, not measured: the value that moves a point at the edge
  // of a typical image by about 1.5 px. These sigmas shift every entropy of a
  // group by one constant and do not affect the ranking. The usual values
  // contain those of lenses without much distortion; narrow ones have larger
  // values that cancel (0.26 -0.95 1.16 for k1 k2 k3 of TUM's Freiburg 1).
  static constexpr CameraCoefficient kCoefficients[] = {
      {.name = "k1", .sigma_ref = 5e-3, .valid = kValid, .usual = {-0.4, 0.2}},
      {.name = "k2", .sigma_ref = 5e-3, .valid = kValid, .usual = {-0.1, 0.1}},
      {.name = "p1", .sigma_ref = 5e-4, .valid = kValid, .usual = kTangential},
      {.name = "p2", .sigma_ref = 5e-4, .valid = kValid, .usual = kTangential},
      {.name = "k3",
       .sigma_ref = 5e-3,
       .valid = kValid,
       .usual = {-0.05, 0.05}}};
  static constexpr ToolModel kTools[] = {
      {.tool = "orb_slam3",
       .name = "PinHole",
       .coefficients = "k1 k2 p1 p2 k3"},
      {.tool = "vins_fusion",
       .name = "PINHOLE_FULL",
       .coefficients = "distortion_parameters.k1 distortion_parameters.k2 "
                       "distortion_parameters.p1 distortion_parameters.p2 "
                       "distortion_parameters.k3",
       .zeros = "distortion_parameters.k4 distortion_parameters.k5 "
                "distortion_parameters.k6",
       .pixels = "projection_parameters.fx projection_parameters.fy "
                 "projection_parameters.cx projection_parameters.cy"},
      {.tool = "basalt",
       .name = "pinhole-radtan8",
       .coefficients = "k1 k2 p1 p2 k3",
       .zeros = "k4 k5 k6"},
      {.tool = "camera_info", .name = "plumb_bob"},
      {.tool = "camera_info",
       .name = "rational_polynomial",
       .zeros = "k4 k5 k6"}};

  using RadialTangential::RadialTangential;
};

}  // namespace selfcal
