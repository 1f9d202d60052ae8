// The turns between keyframes as the fed rates measure them, under a
// hypothesis about what was fed. Internal to core/preflight.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/model/calibration.h"
#include "core/preflight/motion_data.h"

namespace selfcal {

// The readings in the frame and units of the documentation are M times those
// that were fed, at a time that is later than the keyframes say by offset_s:
//   Log(R_GI0^T R_GI1) = turn by M w~ over [t0 + offset, t1 + offset].
struct RateHypothesis {
  Eigen::Matrix3d M = Eigen::Matrix3d::Identity();
  double offset_s = 0;
};

struct RateFit {
  int intervals = 0;     // that the samples cover
  double turn_rad = 0;   // trimmed root mean square of the keyframes' turns
  double error_rad = 0;  // and of what is left
  // What is left by the turns: 0 perfect, 1 as if the rates were zero.
  double share() const { return turn_rad > 0 ? error_rad / turn_rad : 1; }
};

// By integration of the readings less the biases that the SLAM system states.
RateFit FitRates(const MotionData& data,
                 const ImuCalibration& imu,
                 const RateHypothesis& hypothesis);

// The offset near that of the hypothesis that leaves least, by Gauss-Newton
// steps, with its standard deviation by what is left.
struct OffsetFit {
  double offset_s = 0;
  double sigma_s = 0;
};
OffsetFit RefineOffset(const MotionData& data,
                       const ImuCalibration& imu,
                       const RateHypothesis& hypothesis);

// Coarse and cheap, over all axes and offsets: rates are summed as if turns
// were small. `unit` takes what was fed to rad/s.
struct CoarseAlignment {
  double straight_s = 0;  // the best offset with the axes as they are
  double turned_s = 0;    // and with any axes
  // What the axes may be there, signed permutations: few changes first.
  std::vector<Eigen::Matrix3d> axes;
};
CoarseAlignment AlignRates(const MotionData& data, double unit);

// Of the fed rates, summed, to the turns of the keyframes by length.
double SpeedRatio(const MotionData& data);

}  // namespace selfcal
