// The real recordings, as segments: what the device's maker stored is where
// calibrations start.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/model/rig.h"
#include "core/model/segment.h"

namespace selfcal {

struct RecordedDevice {
  std::string name;
  Rig rig;  // rig.factory is the stored calibration
  std::vector<MotionSegment> segments;
};

// tango_handheld in segments of 40 keyframes, with a pixel sigma of 0.8 px and
// bias walks of 5e-5 rad/s^2/sqrt(Hz) and 2e-3 m/s^3/sqrt(Hz) instead of the
// very loose ones of the file. Nothing where the recording is missing.
std::optional<RecordedDevice> ReadTango();

// EuRoC V1_01 in segments of so many keyframes, a second apart, with the
// states of its odometry; the equidistant room in segments of 20. Nothing where
// the recording is missing.
std::optional<RecordedDevice> ReadEuroc(int keyframes);
std::optional<RecordedDevice> ReadRoom();

// All that are there: the above, EuRoC V1_01 and the equidistant room in
// segments of 20 keyframes.
std::vector<RecordedDevice> ReadRecordings();

}  // namespace selfcal
