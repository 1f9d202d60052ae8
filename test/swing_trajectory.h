// A motion whose coordinates each grow evenly and swing.
#pragma once

#include <array>
#include <cmath>

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
    motion.dw_I.setZero();
    for (const int axis : {2, 1, 0}) {
      const Eigen::Vector3d e = Eigen::Vector3d::Unit(axis);
      const Eigen::Quaterniond turn = Exp(angles_[axis].At(t) * e);
      motion.q_GI = motion.q_GI * turn;
      const Eigen::Vector3d rate = angles_[axis].First(t) * e;
      const Eigen::Vector3d before = turn.conjugate() * motion.w_I;
      motion.w_I = before + rate;
      motion.dw_I = turn.conjugate() * motion.dw_I - rate.cross(before) +
                    angles_[axis].Second(t) * e;
    }
    return motion;
  }

 private:
  const double duration_s_;
  const std::array<Swing, 3> p_;
  const std::array<Swing, 3> angles_;
};

}  // namespace selfcal
