// Motions that leave directions of theta unobserved, with random numbers in
// them.
#pragma once

#include <array>
#include <memory>
#include <numbers>
#include <random>

#include "core/simulation/trajectory.h"
#include "test/swing_trajectory.h"

namespace selfcal {

enum class MotionKind {
  kRest,
  kConstantVelocity,  // without turning
  kOneAxis,           // turns about one axis, in place
  kRotationOnly,
  kPlanar,  // drives on level ground, rotating
  kHover,   // centimetres and a degree about one place
  kHandheld,
};

inline std::unique_ptr<Trajectory> RandomMotion(MotionKind kind,
                                                double duration_s,
                                                std::mt19937* random) {
  const auto uniform = [random](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(*random);
  };
  if (kind == MotionKind::kHandheld) {
    return MakeHandheld(duration_s, uniform(0.05, 1), (*random)());
  }
  const auto swing = [&](double amplitude) {
    return Swing{.offset = 0,
                 .rate = 0,
                 .amplitude = uniform(0.5, 1) * amplitude,
                 .omega = uniform(2, 8),
                 .phase = uniform(0, 2 * std::numbers::pi)};
  };
  std::array<Swing, 3> p;
  std::array<Swing, 3> angles;
  for (int axis = 0; axis < 3; ++axis) {
    switch (kind) {
      case MotionKind::kConstantVelocity:
        p[axis].rate = uniform(-1, 1);
        break;
      case MotionKind::kOneAxis:
        if (axis == 0) angles[(*random)() % 3] = swing(0.5);
        break;
      case MotionKind::kRotationOnly:
        angles[axis] = swing(0.5);
        break;
      case MotionKind::kPlanar:
        if (axis < 2) p[axis] = swing(0.5);
        if (axis == 2) angles[axis] = swing(0.5);
        break;
      case MotionKind::kHover:
        p[axis] = swing(0.02);
        angles[axis] = swing(0.02);
        break;
      case MotionKind::kRest:
      case MotionKind::kHandheld:
        break;
    }
    p[axis].offset = uniform(-1, 1);
    angles[axis].offset = axis == 2
                              ? uniform(-std::numbers::pi, std::numbers::pi)
                              : uniform(-0.3, 0.3);
  }
  // On level ground the device does not tilt.
  if (kind == MotionKind::kPlanar) angles[0].offset = angles[1].offset = 0;
  return std::make_unique<SwingTrajectory>(duration_s, p, angles);
}

}  // namespace selfcal
