// Messages of the ROS package sensor_msgs, as far as recordings need them. ROS
// 1 and ROS 2 have the same fields but for the number in the header.
//
// Pure functions, callable from any thread. Errors are DATA_LOSS.
#pragma once

#include <absl/status/statusor.h>

#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

#include "client/recording/wire_reader.h"
#include "core/model/segment.h"

namespace selfcal::client {

// Bytes from the start of a message that hold its stamp.
inline constexpr std::size_t kStampBytes = 12;

// The stamp in the header with which a message begins.
absl::StatusOr<std::int64_t> ParseStamp(Wire wire, std::string_view message);

// sensor_msgs/Image; views into the message.
struct RosImage {
  std::uint32_t height = 0;
  std::uint32_t width = 0;
  std::string_view encoding;  // "mono8"
  bool is_bigendian = false;
  std::uint32_t step = 0;  // bytes of a row
  std::string_view data;
};
absl::StatusOr<RosImage> ParseImage(Wire wire, std::string_view message);

// sensor_msgs/CompressedImage: the bytes of the image's file, a view into the
// message.
absl::StatusOr<std::string_view> ParseCompressedImage(Wire wire,
                                                      std::string_view message);

// sensor_msgs/Imu, in rad/s and m/s^2; an error also for readings that are not
// finite.
absl::StatusOr<ImuSample> ParseImu(Wire wire, std::string_view message);

// sensor_msgs/CameraInfo.
struct RosCameraInfo {
  std::uint32_t height = 0;
  std::uint32_t width = 0;
  std::string_view distortion_model;  // a view into the message
  std::vector<double> d;
  std::vector<double> k;  // 3 x 3, row by row
  std::vector<double> r;  // 3 x 3, row by row
  std::vector<double> p;  // 3 x 4, row by row
  std::uint32_t binning_x = 0;
  std::uint32_t binning_y = 0;
  std::uint32_t roi_width = 0;  // 0: the whole image
  std::uint32_t roi_height = 0;
};
absl::StatusOr<RosCameraInfo> ParseCameraInfo(Wire wire,
                                              std::string_view message);

}  // namespace selfcal::client
