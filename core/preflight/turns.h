// The rotations between keyframes as measured by the received rates, under a
// hypothesis about the received data. Internal to core/preflight.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/model/calibration.h"
#include "core/preflight/motion_data.h"

namespace selfcal {

// Least number of intervals that a fit rests on.
inline constexpr int kMinIntervals = 10;
// Residual share of the rotations below which rates explain them.
inline constexpr double kExplained = 0.25;

// Root mean square of the speed of the keyframes' rotations [rad/s].
double MeanSpeed(const MotionData& data);

// True if there are enough intervals, and the motion can be distinguished from
// the errors of a SLAM system.
bool Turns(const MotionData& data);

// The readings in the documented frame and units are M times the received ones,
// at a time that is offset_s later than the timestamps of the keyframes:
//   Log(R_GI0^T R_GI1) = rotation by M w~ over [t0 + offset, t1 + offset].
struct RateHypothesis {
  Eigen::Matrix3d M = Eigen::Matrix3d::Identity();
  double offset_s = 0;
};

struct RateFit {
  int intervals = 0;     // that the samples cover
  double turn_rad = 0;   // trimmed root mean square of the keyframes' rotations
  double error_rad = 0;  // and of the residual
  // Residual relative to the rotations: 0 perfect, 1 as if the rates were zero.
  double share() const { return turn_rad > 0 ? error_rad / turn_rad : 1; }
};

// Integrates the readings, corrected by `imu` and by the biases of the
// keyframes and mapped by the hypothesis, between keyframes. The residual is
// the rotation left between this and the stated one [rad], trimmed over all
// intervals.
RateFit FitRates(const MotionData& data,
                 const ImuCalibration& imu,
                 const RateHypothesis& hypothesis);

// The offset with the least residual near that of the hypothesis, by
// Gauss-Newton steps, with its standard deviation estimated from the residual.
struct OffsetFit {
  double offset_s = 0;
  double sigma_s = 0;
};
OffsetFit RefineOffset(const MotionData& data,
                       const ImuCalibration& imu,
                       const RateHypothesis& hypothesis);

inline constexpr double kCoarseStep_s = 0.02;

// Coarse and fast alignment over all axes and offsets: rates are summed as if
// rotations were small. `unit` converts received rates to rad/s.
struct CoarseAlignment {
  double straight_s = 0;  // best offset with unchanged axes
  double turned_s = 0;    // best offset with any axes
  // Possible axes at that offset, signed permutations: fewer changes first.
  std::vector<Eigen::Matrix3d> axes;
};
CoarseAlignment AlignRates(const MotionData& data, double unit);

// Ratio of the received rates, summed, to the keyframes' rotations, by norm.
double SpeedRatio(const MotionData& data);

}  // namespace selfcal
