#include "client/recording/ros_messages.h"

#include <absl/status/status.h>

#include <limits>

namespace selfcal::client {
namespace {

constexpr std::int64_t kSecond_ns = 1'000'000'000;
constexpr int kCovariance = 9;

absl::Status CutOff() {
  return absl::DataLossError("the message is not as its type demands");
}

// Leaves an impossible stamp at -1.
std::int64_t ReadStamp(Wire wire, WireReader* reader) {
  if (wire == Wire::kRos1) reader->Read<std::uint32_t>();  // sequence number
  const std::int64_t seconds = reader->Read<std::uint32_t>();
  const std::int64_t rest_ns = reader->Read<std::uint32_t>();
  // Seconds of ROS 2 are signed, and no recording is from before 1970.
  const bool valid = reader->ok() && rest_ns < kSecond_ns &&
                     (wire == Wire::kRos1 ||
                      seconds <= std::numeric_limits<std::int32_t>::max());
  return valid ? seconds * kSecond_ns + rest_ns : -1;
}

std::int64_t ReadHeader(Wire wire, WireReader* reader) {
  const std::int64_t t_ns = ReadStamp(wire, reader);
  reader->ReadString();  // frame_id
  return t_ns;
}

Eigen::Vector3d ReadVector(WireReader* reader) {
  Eigen::Vector3d v;
  for (int i = 0; i < 3; ++i) v[i] = reader->Read<double>();
  return v;
}

}  // namespace

absl::StatusOr<std::int64_t> ParseStamp(Wire wire, std::string_view message) {
  WireReader reader(wire, message);
  const std::int64_t t_ns = ReadStamp(wire, &reader);
  if (t_ns < 0) return CutOff();
  return t_ns;
}

absl::StatusOr<RosImage> ParseImage(Wire wire, std::string_view message) {
  WireReader reader(wire, message);
  ReadHeader(wire, &reader);
  RosImage image;
  image.height = reader.Read<std::uint32_t>();
  image.width = reader.Read<std::uint32_t>();
  image.encoding = reader.ReadString();
  image.is_bigendian = reader.Read<std::uint8_t>() != 0;
  image.step = reader.Read<std::uint32_t>();
  image.data = reader.ReadBytes();
  if (!reader.ok()) return CutOff();
  return image;
}

absl::StatusOr<std::string_view> ParseCompressedImage(
    Wire wire, std::string_view message) {
  WireReader reader(wire, message);
  ReadHeader(wire, &reader);
  reader.ReadString();  // format
  const std::string_view data = reader.ReadBytes();
  if (!reader.ok()) return CutOff();
  return data;
}

absl::StatusOr<ImuSample> ParseImu(Wire wire, std::string_view message) {
  WireReader reader(wire, message);
  ImuSample sample;
  sample.t_ns = ReadHeader(wire, &reader);
  reader.ReadDoubles(4 + kCovariance);  // orientation
  sample.gyro = ReadVector(&reader);
  reader.ReadDoubles(kCovariance);
  sample.accel = ReadVector(&reader);
  reader.ReadDoubles(kCovariance);
  if (!reader.ok() || sample.t_ns < 0) return CutOff();
  if (!sample.gyro.allFinite() || !sample.accel.allFinite()) {
    return absl::DataLossError("the reading is not finite");
  }
  return sample;
}

absl::StatusOr<RosCameraInfo> ParseCameraInfo(Wire wire,
                                              std::string_view message) {
  WireReader reader(wire, message);
  ReadHeader(wire, &reader);
  RosCameraInfo info;
  info.height = reader.Read<std::uint32_t>();
  info.width = reader.Read<std::uint32_t>();
  info.distortion_model = reader.ReadString();
  info.d = reader.ReadDoubles(reader.Read<std::uint32_t>());
  info.k = reader.ReadDoubles(9);
  info.r = reader.ReadDoubles(9);
  info.p = reader.ReadDoubles(12);
  info.binning_x = reader.Read<std::uint32_t>();
  info.binning_y = reader.Read<std::uint32_t>();
  reader.Read<std::uint32_t>();  // x offset
  reader.Read<std::uint32_t>();  // y offset
  info.roi_height = reader.Read<std::uint32_t>();
  info.roi_width = reader.Read<std::uint32_t>();
  if (!reader.ok()) return CutOff();
  return info;
}

}  // namespace selfcal::client
