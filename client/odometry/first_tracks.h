// Tracks of the first seconds of a recording, for what compares them with the
// gyroscope.
#pragma once

#include <vector>

#include "client/recording/recording.h"
#include "core/initialisation/rotation_start.h"
#include "core/model/camera.h"

namespace selfcal::client {

// The tracks of one camera over the first 20 s: those of the recording, or
// followed by the images alone, since the gyroscope does not help before it is
// known where the camera looks. Images that cannot be read are left out.
std::vector<TrackedImage> FirstTracks(Recording* recording,
                                      const CameraCalibration& theta,
                                      int camera);

}  // namespace selfcal::client
