// The specific force between keyframes according to their velocities, and that
// of the received readings. Internal to core/preflight.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "core/model/calibration.h"
#include "core/preflight/motion_data.h"

namespace selfcal {

// Means over one interval, in G. The attitude in between is interpolated with a
// constant rate from one keyframe to the other, so that the check is
// independent of the gyroscope.
struct ForceInterval {
  Eigen::Vector3d acceleration;  // (v_1 - v_0) / dt
  // Means of R_GI R_AI^T T_a^-1 times each received axis; the force is linear
  // in the axes M, see Force().
  std::array<Eigen::Matrix3d, 3> turned;  // [k](i, j): of received axis k
  Eigen::Vector3d bias;

  // The mean force in G if true readings are M times the received ones.
  Eigen::Vector3d Force(const Eigen::Matrix3d& M) const {
    Eigen::Vector3d force = -bias;
    for (int k = 0; k < 3; ++k) force += turned[k] * M.col(k);
    return force;
  }
};

// Forces of the intervals that the samples cover when keyframes are `offset_s`
// later than their timestamps.
std::vector<ForceInterval> CollectForces(const MotionData& data,
                                         const ImuCalibration& imu,
                                         double offset_s);

// Median norm of the received accelerations; 0 if there are none.
double MedianAcceleration(const MotionData& data);

}  // namespace selfcal
