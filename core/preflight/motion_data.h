// Input of the IMU checks: the motion between keyframes as the SLAM system
// states it, and the received samples. Internal to core/preflight.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/model/segment.h"

namespace selfcal {

// Motion from one keyframe to another of the same segment.
struct MotionInterval {
  std::size_t segment = 0;  // into MotionData::imu
  KeyframeState from;
  KeyframeState to;
  double dt_s = 0;
  Eigen::Vector3d turn = Eigen::Vector3d::Zero();  // Log(R_GI0^T R_GI1) [rad]
};

struct MotionData {
  // Samples of each segment that are finite and later than the previous ones.
  std::vector<std::vector<ImuSample>> imu;
  std::vector<MotionInterval> intervals;
  // Mean time of the segments since their sessions began.
  double session_s = 0;
};

// True if the state can be used.
bool IsFinite(const KeyframeState& state);

// Samples that are finite and later than the previous ones.
std::vector<ImuSample> UsableSamples(std::span<const ImuSample> samples);

// Collects intervals of at least a quarter of a second, for which the relative
// accuracy of a SLAM system's rotation is better than for shorter ones, and of
// at most three seconds. Long data is subsampled evenly to about 2000
// intervals.
MotionData CollectMotion(std::span<const MotionSegment> segments);

// The same intervals with the keyframes' attitudes times R_BI as those of the
// body: R_GI = R_GB R_BI.
MotionData InBody(const MotionData& data, const Eigen::Matrix3d& R_BI);

// Root mean square of the smallest nine tenths: a few jumps of the SLAM system
// are not a finding. Sorts `norms`; 0 if empty.
double TrimmedRms(std::vector<double>* norms);

// "0.102", three digits.
std::string Figure(double value);

}  // namespace selfcal
