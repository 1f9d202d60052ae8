// The common part of the camera chains of Kalibr and OpenVINS, and of the noise
// of their IMU.
#pragma once

#include <yaml-cpp/yaml.h>

#include <string>
#include <vector>

#include "client/formats/format.h"
#include "core/model/rig.h"

namespace selfcal::client {

// The file with the cameras and the file with the IMU, found by their content.
// FormatError unless both are given.
struct ChainFiles {
  YAML::Node cameras;
  YAML::Node imu;             // the node imu0, or the whole file
  bool several_imus = false;  // the file has imu1 as well
};
ChainFiles ReadChainFiles(const std::vector<TextFile>& files);

// Reads and writes f, c, distortion, size and time offset of cam0, cam1, ...;
// no extrinsics.
CameraCalibration ReadChainCamera(const YAML::Node& node);
std::string ChainCameraText(const CameraCalibration& camera);

// Reads and writes continuous-time noise densities, as selfcal has them; the
// text has rate and topic as well, and `indent` before each line.
ImuNoise ReadChainNoise(const YAML::Node& imu);
std::string ChainNoiseText(const ImuNoise& noise,
                           double rate_hz,
                           const std::string& indent);

}  // namespace selfcal::client
