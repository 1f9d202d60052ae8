// ROS: camera_info, one YAML file for each camera, as camera_info_manager loads
// and camera_calibration writes them (camera_calibration_parsers).
//
// It has the intrinsics of one camera, a pinhole with plumb_bob (k1 k2 p1 p2
// k3), rational_polynomial (k1 k2 p1 p2 k3 k4 k5 k6) or equidistant (k1 .. k4),
// and its rectification: a rotation, and the projection of the rectified image.
// It has no pose, no time offset and no IMU. Cameras are numbered in the order
// of the files.
#pragma once

#include <vector>

#include "client/formats/format.h"

namespace selfcal::client {

ImportedRig ImportCameraInfo(const std::vector<TextFile>& files,
                             const FormatOptions& options);
ExportedFiles ExportCameraInfo(const Rig& rig,
                               const Calibration& theta,
                               const FormatOptions& options);

}  // namespace selfcal::client
