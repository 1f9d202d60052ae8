// Descriptions of components and directions of theta in plain words, for the
// user of the device. Pure.
#pragma once

#include <string>
#include <string_view>

#include "core/information/segment_information.h"

namespace selfcal {

// "the accelerometer's scale on z" for "imu.accel.scale.z"; an unknown name is
// returned unchanged.
std::string ComponentInWords(std::string_view component);

// "the accelerometer's scale on z", or "a combination of ... and ..." of the
// largest parts, at most three. A direction has at least one part.
std::string DirectionInWords(const UnobservedDirection& direction);

}  // namespace selfcal
