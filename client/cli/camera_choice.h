// The cameras of a rig that are used.
#pragma once

#include <absl/status/status.h>

#include <string>
#include <vector>

#include "client/formats/format.h"
#include "core/model/rig.h"

namespace selfcal::client {

// Keeps the cameras with these names, cam0, cam1, ... in the order of the rig;
// those that are kept are numbered anew. Removes the losses of the others, and
// adds a note for each camera whose name changes. INVALID_ARGUMENT, with the
// cameras that there are, for another name or one that is given twice.
absl::Status KeepCameras(const std::vector<std::string>& names,
                         Rig* rig,
                         std::vector<Loss>* losses);

}  // namespace selfcal::client
