// VINS-Fusion: its configuration, and a camera file of camodocal for each.
//
// body_T_camN takes a point from the camera's frame to the IMU's. The IMU's
// readings are used as they are; image time + td = IMU time, one td for all.
// PINHOLE has fx fy cx cy and k1 k2 p1 p2, PINHOLE_FULL also k3 .. k6;
// KANNALA_BRANDT has mu mv u0 v0 for f and c, and k2 .. k5 for k1 .. k4; MEI
// has gamma1 gamma2 u0 v0 for f and c. Noise is per sample: acc_n and gyr_n are
// standard deviations of a reading, density * sqrt(rate), and a bias moves by
// acc_w * dt in a step dt, so that acc_w is the walk's density * sqrt(rate).
#pragma once

#include <vector>

#include "client/formats/format.h"

namespace selfcal::client {

ImportedRig ImportVinsFusion(const std::vector<TextFile>& files,
                             const FormatOptions& options);
ExportedFiles ExportVinsFusion(const Rig& rig,
                               const Calibration& theta,
                               const FormatOptions& options);

}  // namespace selfcal::client
