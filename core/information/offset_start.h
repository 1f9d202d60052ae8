// Start of an estimate of time offsets that are not known: the linearisation
// point of a segment whose SLAM system assumes an offset far from the true one.
//
// A SLAM system with an offset that is wrong by d has images, landmarks and
// states that agree with each other, but its states are those of the body at
// times that are later by d than their stamps. From there, neither a score nor
// a calibration is in the linear range: the rotation of a hand-held device in
// 50 ms is tens of pixels. The gyroscope shows d
// (core/preflight/time_offset.h). The states are moved back along the IMU
// samples to their stamps, and the offset of the cameras becomes larger by d,
// unless theta has it already, since it is newer than that of the SLAM system:
// then the residuals are smaller without.
//
// Pure, callable from any thread.
#pragma once

#include <optional>
#include <string>

#include "core/model/calibration.h"
#include "core/model/rig.h"
#include "core/model/segment.h"

namespace selfcal {

// Smaller errors are in the linear range.
inline constexpr double kFarTimeOffset_s = 0.012;

// Returns whether the rig estimates this component of every camera
// ("time_offset"): only then may it start elsewhere.
bool IsEstimatedOfAllCameras(const Rig& rig, const std::string& component);

struct OffsetStart {
  Calibration theta;      // with other time offsets, if they become larger
  double shift_s = 0;     // by which they are larger: d or 0
  MotionSegment segment;  // with its states at their stamps
};

// nullopt if the segment is to be used as it is: its states hold at their
// stamps to within kFarTimeOffset_s, as far as the gyroscope can tell, or the
// rig does not estimate the time offset of every camera. The segment must be
// valid for the rig.
std::optional<OffsetStart> FindOffsetStart(const Rig& rig,
                                           const Calibration& theta,
                                           const MotionSegment& segment);

}  // namespace selfcal
