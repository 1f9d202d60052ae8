// Kalibr: camchain-imucam.yaml and imu.yaml, in the form in which Kalibr takes
// them as --cams and --imu. The IMU of a result, below imu0, is read as well.
//
// T_cam_imu takes a point from the IMU's frame to the camera's, and
// t_imu = t_cam + timeshift_cam_imu. The IMU's frame is that in which the
// accelerometer's matrix is lower triangular:
//   accel = M_a f + b_a,   gyro = M_g C_gyro_i w + A_g C_gyro_i f + b_g,
// with M_g lower triangular, too; A_g is the gyroscope's sensitivity to
// acceleration, of which f is that at the origin. The axes of the accelerometer
// are at rx_i, ry_i and rz_i, before M_a mixes them. The format can express
// everything that selfcal has but for radial-tangential models of more than 4
// coefficients; yet Kalibr reads no matrices.
#pragma once

#include <vector>

#include "client/formats/format.h"

namespace selfcal::client {

ImportedRig ImportKalibr(const std::vector<TextFile>& files,
                         const FormatOptions& options);
ExportedFiles ExportKalibr(const Rig& rig,
                           const Calibration& theta,
                           const FormatOptions& options);

}  // namespace selfcal::client
