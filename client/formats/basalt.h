// Basalt: calibration.json.
//
// T_imu_cam takes a point from the camera's frame to the IMU's, quaternions are
// x y z w, and image time + cam_time_offset_ns = IMU time, with one offset for
// all cameras, which Basalt's calibration applies and its odometry does not.
// Basalt's matrices are the inverses of selfcal's,
//   f = (1 + M_a) accel - b,   w = (1 + M_g) gyro - b,
// with M_a lower triangular and M_g full. They are stored as b_0 b_1 b_2 M_00
// M_10 M_20 M_11 M_21 M_22, and as b_0 b_1 b_2 with the columns of M_g. The
// IMU's frame is therefore the one in which the accelerometer's matrix is lower
// triangular. The format can express everything that selfcal has, except time
// offsets that differ between cameras; constant biases are written as 0.
// Cameras: kb4, eucm, ds, pinhole-radtan8; pinhole. basalt-headers has a FOV
// camera, too, but its loader does not.
#pragma once

#include <vector>

#include "client/formats/format.h"

namespace selfcal::client {

ImportedRig ImportBasalt(const std::vector<TextFile>& files,
                         const FormatOptions& options);
ExportedFiles ExportBasalt(const Rig& rig,
                           const Calibration& theta,
                           const FormatOptions& options);

}  // namespace selfcal::client
