// Motions that leave directions of theta unobserved, with random numbers in
// them: each coordinate grows evenly and swings.
#pragma once

#include <array>
#include <cmath>
#include <memory>
#include <numbers>
#include <random>

#include "core/model/so3.h"
#include "core/simulation/trajectory.h"

namespace selfcal {

struct Swing {
  double offset = 0;
  double rate = 0;  // [1/s]
  double amplitude = 0;
  double omega = 1;  // [rad/s]
  double phase = 0;

  double At(double t) const {
    return offset + rate * t + amplitude * std::sin(omega * t + phase);
  }
  double First(double t) const {
    return rate + amplitude * omega * std::cos(omega * t + phase);
  }
  double Second(double t) const {
    return -amplitude * omega * omega * std::sin(omega * t + phase);
  }
};

// p = position(t) [m], q = Exp(yaw e_z) Exp(pitch e_y) Exp(roll e_x) [rad].
class SwingTrajectory final : public Trajectory {
 public:
  SwingTrajectory(double duration_s,
                  const std::array<Swing, 3>& position,
                  const std::array<Swing, 3>& roll_pitch_yaw)
      : duration_s_(duration_s), p_(position), angles_(roll_pitch_yaw) {}

  double duration_s() const override { return duration_s_; }

  BodyMotion At(double t) const override {
    BodyMotion motion;
    motion.p_GI = {p_[0].At(t), p_[1].At(t), p_[2].At(t)};
    motion.v_GI = {p_[0].First(t), p_[1].First(t), p_[2].First(t)};
    motion.a_GI = {p_[0].Second(t), p_[1].Second(t), p_[2].Second(t)};
    motion.q_GI = Eigen::Quaterniond::Identity();
    motion.w_I.setZero();
    for (const int axis : {2, 1, 0}) {
      const Eigen::Vector3d e = Eigen::Vector3d::Unit(axis);
      const Eigen::Quaterniond turn = Exp(angles_[axis].At(t) * e);
      motion.q_GI = motion.q_GI * turn;
      motion.w_I = turn.conjugate() * motion.w_I + angles_[axis].First(t) * e;
    }
    return motion;
  }

 private:
  const double duration_s_;
  const std::array<Swing, 3> p_;
  const std::array<Swing, 3> angles_;
};

enum class MotionKind {
  kRest,
  kConstantVelocity,  // without turning
  kOneAxis,           // turns about one axis, in place
  kRotationOnly,
  kPlanar,  // drives on level ground, turning
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
  // On level ground the device does not lean.
  if (kind == MotionKind::kPlanar) angles[0].offset = angles[1].offset = 0;
  return std::make_unique<SwingTrajectory>(duration_s, p, angles);
}

}  // namespace selfcal
