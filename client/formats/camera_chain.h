// The common part of the camera chains of Kalibr and OpenVINS, and of the noise
// of their IMU.
#pragma once

#include <yaml-cpp/yaml.h>

#include <string>
#include <vector>

#include "client/formats/format.h"
#include "core/model/rig.h"

namespace selfcal::client {

// The file with the cameras and that with the IMU, found by their content.
struct ChainFiles {
  YAML::Node cameras;
  // imu0, imu1, ... of a file that has them; else the whole files, in their
  // order. At least one.
  std::vector<YAML::Node> imus;
};
// FormatError unless there is one file of cameras and, besides, at least one
// and at most `imu_files`.
ChainFiles ReadChainFiles(const std::vector<TextFile>& files, int imu_files);

// Reads and writes f, c, distortion, size and time offset of cam0, cam1, ...;
// no extrinsics.
CameraCalibration ReadChainCamera(const YAML::Node& node);
std::string ChainCameraText(const CameraCalibration& camera);

// Reads and writes continuous-time noise densities, as selfcal has them; the
// text has rate and topic as well, and `indent` before each line. `imu` is the
// number of the IMU, and its time offset t_imu0 - t_imu.
ImuNoise ReadChainNoise(const YAML::Node& imu);
std::string ChainNoiseText(const ImuNoise& noise,
                           int imu,
                           double time_offset_s,
                           double rate_hz,
                           const std::string& indent);

}  // namespace selfcal::client
