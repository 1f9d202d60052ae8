// Pixels of sensor_msgs/Image as grey.
//
// Pure functions, callable from any thread.
#pragma once

#include <absl/status/statusor.h>

#include "client/recording/grey_pixels.h"
#include "client/recording/ros_messages.h"

namespace selfcal::client {

// Converts the pixels as a PNG of them would be read: 16 bits are rounded to 8,
// colours weighted as by ITU-R BT.709, and opacity is ignored. A Bayer pattern
// becomes (R + 2 G + B) / 4, by the kernel (1 2 1) of rows and columns, which
// moves no edge; of YUV 4:2:2, Y is used. DATA_LOSS for sizes that do not fit
// the data or exceed the limits of grey_pixels.h, UNIMPLEMENTED with the list
// of encodings for another one.
absl::StatusOr<GreyPixels> ConvertImage(const RosImage& image);

}  // namespace selfcal::client
