// Poses of cameras on the command line, for files that have none.
#pragma once

#include <absl/status/status.h>

#include <string>
#include <vector>

#include "client/formats/format.h"
#include "core/model/rig.h"

namespace selfcal::client {

// Sets the poses of cameras from "cam0=PX,PY,PZ,QX,QY,QZ,QW": T_CI, which takes
// a point from the IMU's frame to the camera's, p_CI in m. Removes the losses
// that say that they are missing. INVALID_ARGUMENT for a text of another form,
// and for a camera that is not there or is given twice.
absl::Status SetExtrinsics(const std::vector<std::string>& texts,
                           Rig* rig,
                           std::vector<Loss>* losses);

}  // namespace selfcal::client
