// ORB-SLAM3: the calibration in its settings file (File.version 1.0).
//
// IMU.T_b_c1 takes a point from the left camera's frame to the body's, and
// Stereo.T_c1_c2 from the right one's to the left one's. PinHole has k1 k2 p1
// p2 (and k3), KannalaBrandt8 has k1 .. k4. The body's frame is that of the
// IMU, whose readings are used as they are; noise densities are for continuous
// time. There are one or two cameras, with the same model and image size.
#pragma once

#include <vector>

#include "client/formats/format.h"

namespace selfcal::client {

ImportedRig ImportOrbSlam3(const std::vector<TextFile>& files,
                           const FormatOptions& options);
ExportedFiles ExportOrbSlam3(const Rig& rig,
                             const Calibration& theta,
                             const FormatOptions& options);

}  // namespace selfcal::client
