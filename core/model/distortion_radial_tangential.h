// The radial-tangential model with two radial coefficients, k1 k2 p1 p2: the
// factor L = 1 + k1 r^2 + k2 r^4 in radial_tangential.h, which has the
// mathematics.
#pragma once

#include <string_view>

#include "core/model/camera_model.h"
#include "core/model/radial_tangential.h"

namespace selfcal {

class DistortionRadialTangential
    : public RadialTangential<RadialPolynomial<2>> {
  static constexpr Interval kValid = {-1e3, 1e3};
  static constexpr Interval kTangential = {-2e-3, 2e-3};

 public:
  static constexpr std::string_view kName = "radial-tangential";
  // sigma_ref is chosen, not measured: the value that moves a point at the edge
  // of a typical image by about 1.5 px. These sigmas shift every entropy of a
  // group by one constant and do not affect the ranking.
  static constexpr CameraCoefficient kCoefficients[] = {
      {.name = "k1", .sigma_ref = 5e-3, .valid = kValid, .usual = {-0.4, 0.2}},
      {.name = "k2", .sigma_ref = 5e-3, .valid = kValid, .usual = {-0.1, 0.1}},
      {.name = "p1", .sigma_ref = 5e-4, .valid = kValid, .usual = kTangential},
      {.name = "p2", .sigma_ref = 5e-4, .valid = kValid, .usual = kTangential}};
  static constexpr ToolModel kTools[] = {
      {.tool = "kalibr", .name = "pinhole", .distortion = "radtan"},
      {.tool = "openvins", .name = "pinhole", .distortion = "radtan"},
      {.tool = "orb_slam3",
       .name = "PinHole",
       .coefficients = "k1 k2 p1 p2",
       .zeros = "k3"},
      {.tool = "vins_fusion",
       .name = "PINHOLE",
       .coefficients = "distortion_parameters.k1 distortion_parameters.k2 "
                       "distortion_parameters.p1 distortion_parameters.p2",
       .pixels = "projection_parameters.fx projection_parameters.fy "
                 "projection_parameters.cx projection_parameters.cy"},
      {.tool = "vins_fusion",
       .name = "PINHOLE_FULL",
       .coefficients = "distortion_parameters.k1 distortion_parameters.k2 "
                       "distortion_parameters.p1 distortion_parameters.p2",
       .zeros = "distortion_parameters.k3 distortion_parameters.k4 "
                "distortion_parameters.k5 distortion_parameters.k6",
       .pixels = "projection_parameters.fx projection_parameters.fy "
                 "projection_parameters.cx projection_parameters.cy"},
      {.tool = "basalt",
       .name = "pinhole-radtan8",
       .coefficients = "k1 k2 p1 p2",
       .zeros = "k3 k4 k5 k6"},
      {.tool = "maplab", .name = "pinhole", .distortion = "radial-tangential"},
      {.tool = "camera_info", .name = "plumb_bob", .zeros = "k3"},
      {.tool = "camera_info",
       .name = "rational_polynomial",
       .zeros = "k3 k4 k5 k6"}};

  using RadialTangential::RadialTangential;
};

}  // namespace selfcal
