// Readings of an IMU at or beyond its full scale: the motion was faster than
// the sensor can tell, or the reading is corrupt. They are left out, so that
// the time around them is a gap of the IMU.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "core/model/rig.h"
#include "core/model/segment.h"

namespace selfcal {

// A larger part of the readings is not due to single shocks: it stems from a
// wrong unit, or from a full scale that the rig does not state.
inline constexpr double kMaxSaturatedFraction = 0.02;

// The readings are all of a segment, or those between its keyframes, which no
// other segment has.
std::size_t CountSaturatedReadings(std::span<const ImuSample> samples,
                                   const ImuFullScale& full_scale);

// True if `count` of these readings are more than kMaxSaturatedFraction.
bool IsTooSaturated(std::span<const ImuSample> samples, std::size_t count);

void RemoveSaturatedReadings(const ImuFullScale& full_scale,
                             std::vector<ImuSample>* samples);

}  // namespace selfcal
