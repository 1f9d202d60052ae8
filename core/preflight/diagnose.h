// Pre-flight: is the data of a rig wrong in one of the usual ways, and in
// which?
//
// A SLAM system with a driver of its own may work well while what is handed on
// is not what its documentation says: axes, units, signs, frames, stamps. Such
// data is accepted, scored and calibrated with, and only the result is absurd.
// Each check here is a small estimation problem: it fits the data under the
// usual mistakes, and reports one where it explains what the data as it stands
// does not. A check that the data cannot answer says so: a device at rest tells
// nothing about the axes of its gyroscope.
//
// Pure, deterministic, any thread. Segments need not be valid: what cannot be
// used (an index out of range, a number that is not finite) is passed over.
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
  kGravity,          // with the wrong sign, removed, or G not level
  kTimeOffset,       // between the stamps of keyframes and samples
  kDroppedSamples,   // gaps in the stream of the IMU
  kRepeatedSamples,  // readings or stamps twice
  kSaturation,       // readings at the end of the sensor's range
  kExtrinsics,       // inverted, or keyframes are those of the camera
  kFocalLength,      // intrinsics of another resolution
  kLandmarkFrame,    // landmarks not in G
  // Wrong, but in none of the ways above.
  kGyroMismatch,
  kAccelMismatch,
  kReprojectionMismatch,
};

// "imu-axes", "gyro-units", ...
std::string_view FindingName(FindingKind kind);

struct Finding {
  FindingKind kind = FindingKind::kImuAxes;
  std::string cause;   // in words, with the figure that it rests on
  std::string remedy;  // what to do about it
  // What was measured: the factor of a unit or a focal length, the offset [s],
  // the share of samples dropped, repeated or saturated; else the error as the
  // data stands over that of the explanation.
  double value = 0;
};

struct Diagnosis {
  std::vector<Finding> findings;
  std::vector<std::string> checked;      // and on how much data
  std::vector<std::string> not_checked;  // and why not
};

// Segments of one rig; `theta` is what their SLAM system worked with.
Diagnosis Diagnose(const Rig& rig,
                   const Calibration& theta,
                   std::span<const MotionSegment> segments);

}  // namespace selfcal
