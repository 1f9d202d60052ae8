// Compares the derivatives of a trajectory with differences of its poses.
#pragma once

#include <gtest/gtest.h>

#include "core/model/so3.h"
#include "core/simulation/trajectory.h"

namespace selfcal {

// Central differences are off by h^2 / 6 times the third derivative, and by
// rounding over h: 1e-6 relative to the motion is well above both.
inline void ExpectDerivativesMatch(const Trajectory& trajectory, double t_s) {
  constexpr double h = 1e-4;
  const BodyMotion before = trajectory.At(t_s - h);
  const BodyMotion at = trajectory.At(t_s);
  const BodyMotion after = trajectory.At(t_s + h);
  const Eigen::Vector3d v = (after.p_GI - before.p_GI) / (2 * h);
  const Eigen::Vector3d a = (after.v_GI - before.v_GI) / (2 * h);
  const Eigen::Vector3d w = Log(before.q_GI.conjugate() * after.q_GI) / (2 * h);
  EXPECT_LT((at.v_GI - v).norm(), 1e-6 * (1 + v.norm())) << "at " << t_s;
  EXPECT_LT((at.a_GI - a).norm(), 2e-5 * (1 + a.norm())) << "at " << t_s;
  EXPECT_LT((at.w_I - w).norm(), 1e-5 * (1 + w.norm())) << "at " << t_s;
  const Eigen::Vector3d dw = (after.w_I - before.w_I) / (2 * h);
  EXPECT_LT((at.dw_I - dw).norm(), 2e-5 * (1 + dw.norm())) << "at " << t_s;
  EXPECT_NEAR(at.q_GI.norm(), 1, 1e-12);
}

}  // namespace selfcal
