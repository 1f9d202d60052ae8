// maplab: sensors.yaml, as a map has it and as maplab-node takes it.
//
// T_B_C takes a point from the camera's frame to the body's, which is the
// IMU's; extrinsics of the camera system are not used. fisheye is the FOV
// model, unified-projection the unified one. The IMU's readings are used as
// they are, and there are no time offsets; noise densities are for continuous
// time. The first IMU and the first camera system are read.
#pragma once

#include <vector>

#include "client/formats/format.h"

namespace selfcal::client {

ImportedRig ImportMaplab(const std::vector<TextFile>& files,
                         const FormatOptions& options);
ExportedFiles ExportMaplab(const Rig& rig,
                           const Calibration& theta,
                           const FormatOptions& options);

}  // namespace selfcal::client
