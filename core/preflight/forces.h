// The specific force between keyframes as their velocities imply it, beside
// what was fed. Internal to core/preflight.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "core/model/calibration.h"
#include "core/preflight/motion_data.h"

namespace selfcal {

// Means over one interval, in G. Attitude in between is that of an even turn
// from one keyframe to the other, so that the gyroscope is not trusted.
struct ForceInterval {
  Eigen::Vector3d acceleration;  // (v_1 - v_0) / dt
  // Of R_GI R_AI^T T_a^-1 applied to the fed readings with axes M and less the
  // bias: sum over j of column j of turned[j] M^T ... linear in M, see Force().
  std::array<Eigen::Matrix3d, 3> turned;  // [k](i, j): of fed axis k
  Eigen::Vector3d bias;

  // The mean force in G if readings are M times what was fed.
  Eigen::Vector3d Force(const Eigen::Matrix3d& M) const {
    Eigen::Vector3d force = -bias;
    for (int k = 0; k < 3; ++k) force += turned[k] * M.col(k);
    return force;
  }
};

// Of the intervals that the samples cover when keyframes are `offset_s` later
// than they say.
std::vector<ForceInterval> CollectForces(const MotionData& data,
                                         const ImuCalibration& imu,
                                         double offset_s);

// Median length of the fed accelerations; 0 of none.
double MedianAcceleration(const MotionData& data);

}  // namespace selfcal
