// Pre-flight checks: finds the usual mistakes in the data of a rig.
//
// A SLAM system with its own driver may work well although the data that it
// exports is not as documented: axes, units, signs, frames, timestamps. Such
// data is accepted, scored and used for calibration, and only the result is
// absurd. Each check here is a small estimation problem: it fits the data under
// the hypotheses of the usual mistakes, and reports one if it explains the data
// and the data as sent does not fit. A check that the data does not allow is
// reported as such: a device at rest has no information about the axes of its
// gyroscope.
//
// Pure, deterministic, callable from any thread. Segments need not be valid:
// unusable elements (an index out of range, a number that is not finite) are
// ignored.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/model/calibration.h"
#include "core/model/rig.h"
#include "core/model/segment.h"

namespace selfcal {

enum class FindingKind {
  kImuAxes,          // axes of the IMU swapped or flipped
  kGyroUnits,        // rates not in rad/s
  kAccelUnits,       // accelerations not in m/s^2
  kGravity,          // wrong sign, removed, or G not level
  kTimeOffset,       // between the timestamps of keyframes and samples
  kClockDrift,       // of the clocks of cameras and IMU
  kDroppedSamples,   // gaps in the IMU stream
  kRepeatedSamples,  // repeated readings or timestamps
  kSaturation,       // readings at the limit of the sensor's range
  kExtrinsics,       // inverted, or keyframes are poses of the camera
  kFocalLength,      // intrinsics of another resolution
  kLandmarkFrame,    // landmarks not in G
  kRollingShutter,   // rows exposed one after the other
  // Wrong, but for none of the reasons above.
  kGyroMismatch,
  kAccelMismatch,
  kReprojectionMismatch,
};

// "imu-axes", "gyro-units", ...
std::string_view FindingName(FindingKind kind);

struct Finding {
  FindingKind kind = FindingKind::kImuAxes;
  std::string cause;   // in words, with the figure that supports it
  std::string remedy;  // what to do about it
  // Measured value: the factor of a unit or a focal length, the offset [s], the
  // drift [s/s], the time from the first to the last row [s], the share of
  // samples that are dropped, repeated or saturated; otherwise the ratio of the
  // error of the data as sent to that of the explanation.
  double value = 0;
  int imu = 0;  // whose readings it is about; 1 is the second IMU
};

struct Diagnosis {
  std::vector<Finding> findings;
  std::vector<std::string> checked;      // with the amount of data
  std::vector<std::string> not_checked;  // with the reason
  // Mean time of the segments since their sessions began.
  double session_s = 0;
};

// `segments` are of one rig; `theta` is the calibration that their SLAM system
// used, of which all are checked at the median of their temperatures.
Diagnosis Diagnose(const Rig& rig,
                   const Calibration& theta,
                   std::span<const MotionSegment> segments);

}  // namespace selfcal
