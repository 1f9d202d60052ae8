// What the checks of the IMU stand on: the motion between keyframes as the SLAM
// system states it, beside the samples that were fed. Internal to
// core/preflight.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/model/segment.h"

namespace selfcal {

// From one keyframe to another of the same segment.
struct MotionInterval {
  std::size_t segment = 0;  // into MotionData::imu
  KeyframeState from;
  KeyframeState to;
  double dt_s = 0;
  Eigen::Vector3d turn = Eigen::Vector3d::Zero();  // Log(R_GI0^T R_GI1) [rad]
};

struct MotionData {
  // Of each segment the samples that are finite and later than those before.
  std::vector<std::vector<ImuSample>> imu;
  std::vector<MotionInterval> intervals;
};

// Intervals of at least a quarter of a second, which a SLAM system knows better
// than shorter ones in relation to how far they turn, and of at most three.
// Of long data an even choice of about 2000.
MotionData CollectMotion(std::span<const MotionSegment> segments);

// The same intervals if the keyframes' attitudes times R_BI are those of the
// body: R_GI = R_GB R_BI.
MotionData InBody(const MotionData& data, const Eigen::Matrix3d& R_BI);

// Root mean square of the smallest nine tenths: a few jumps of the SLAM system
// are no finding. Sorts `norms`; 0 of none.
double TrimmedRms(std::vector<double>* norms);

// "0.102", three digits.
std::string Figure(double value);

}  // namespace selfcal
