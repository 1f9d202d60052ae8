// The families of checks, a file each. Each adds its findings, and reports what
// it checked or why it could not. Internal to core/preflight.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

#include "core/model/calibration.h"
#include "core/model/rig.h"
#include "core/model/segment.h"
#include "core/preflight/diagnose.h"
#include "core/preflight/motion_data.h"

namespace selfcal {

// Dropped and repeated samples, from timestamps and readings.
void CheckSampling(std::span<const MotionSegment> segments,
                   Diagnosis* diagnosis);

void CheckSaturation(std::span<const MotionSegment> segments,
                     Diagnosis* diagnosis);

// Results of the gyroscope check that the accelerometer check uses.
struct GyroResult {
  double offset_s = 0;  // to be added to timestamps of keyframes
  // The axes of the gyroscope, if they had to be permuted.
  std::optional<Eigen::Matrix3d> axes;
  // R_BI, from the body to the frame that the poses of keyframes refer to: not
  // the identity if the extrinsics were misused.
  Eigen::Matrix3d R_BI = Eigen::Matrix3d::Identity();
};

// Axes and units of the gyroscope, and the time offset.
GyroResult CheckGyro(const Calibration& theta,
                     const MotionData& data,
                     Diagnosis* diagnosis);

// A time offset that grows with the time since a session began.
void CheckClocks(const Calibration& theta,
                 std::span<const MotionSegment> segments,
                 Diagnosis* diagnosis);

// Axes and units of the accelerometer, and gravity.
void CheckAccelerometer(const Rig& rig,
                        const Calibration& theta,
                        const MotionData& data,
                        const GyroResult& gyro,
                        Diagnosis* diagnosis);

// All of these checks on the readings of a second IMU, which `theta` must have.
// Its axes, units and gravity are checked with the motion that the first one
// measures, if `first_is_right`: nothing but single samples or the time offset
// was found wrong.
void CheckSecondImu(const Rig& rig,
                    const Calibration& theta,
                    std::span<const MotionSegment> segments,
                    const GyroResult& first,
                    bool first_is_right,
                    Diagnosis* diagnosis);

// Extrinsics, intrinsics and the frame of the landmarks. `late_s` are those of
// FindLateStates.
void CheckReprojection(const Rig& rig,
                       const Calibration& theta,
                       std::span<const MotionSegment> segments,
                       std::span<const double> late_s,
                       Diagnosis* diagnosis);

// Rows of images that were exposed one after the other, by cameras whose
// shutter is a global one.
void CheckShutter(const Rig& rig,
                  const Calibration& theta,
                  std::span<const MotionSegment> segments,
                  std::span<const double> late_s,
                  Diagnosis* diagnosis);

}  // namespace selfcal
