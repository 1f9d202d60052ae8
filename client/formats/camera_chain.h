// What the camera chains of Kalibr and OpenVINS share, and their IMU's noise.
#pragma once

#include <yaml-cpp/yaml.h>

#include <string>
#include <vector>

#include "client/formats/format.h"
#include "core/model/rig.h"

namespace selfcal::client {

// The file that has cameras, and the one that has the IMU, whatever their
// names. FormatError unless both are there.
struct ChainFiles {
  YAML::Node cameras;
  YAML::Node imu;  // what is under imu0, or the file itself
};
ChainFiles ReadChainFiles(const std::vector<TextFile>& files);

// Of cam0, cam1, ...: f, c, distortion, size and time offset; no extrinsics.
CameraCalibration ReadChainCamera(const YAML::Node& node);
std::string ChainCameraText(const CameraCalibration& camera);

// Densities by continuous time, as selfcal has them.
ImuNoise ReadChainNoise(const YAML::Node& imu);
std::string ChainNoiseText(const ImuNoise& noise, double rate_hz);

}  // namespace selfcal::client
