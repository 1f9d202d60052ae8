// OpenVINS: kalibr_imucam_chain.yaml and kalibr_imu_chain.yaml.
//
// T_imu_cam takes a point from the camera's frame to the IMU's (in older files,
// T_cam_imu is its inverse), and t_imu = t_cam + timeshift_cam_imu, where the
// offset of cam0 applies to all cameras. The matrices are those of the
// readings,
//   accel = Ta R_IMUtoACC f + b_a,
//   gyro  = Tw R_IMUtoGYRO w + Tg f + b_g, f the force that accel reads;
// of their inverses, OpenVINS uses the upper triangle with the model "rpng" and
// the lower triangle with "kalibr". The model is written as "rpng" with
// R_IMUtoGYRO = 1, which is selfcal's own form.
#pragma once

#include <vector>

#include "client/formats/format.h"

namespace selfcal::client {

ImportedRig ImportOpenVins(const std::vector<TextFile>& files,
                           const FormatOptions& options);
ExportedFiles ExportOpenVins(const Rig& rig,
                             const Calibration& theta,
                             const FormatOptions& options);

}  // namespace selfcal::client
