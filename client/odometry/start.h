// A start for the calibration of a device of which little is known, from its
// recording itself.
#pragma once

#include <absl/status/statusor.h>

#include <string>

#include "client/recording/recording.h"
#include "core/model/calibration.h"
#include "core/model/rig.h"

namespace selfcal::client {

struct CalibrationStart {
  Calibration theta;
  int segments = 0;  // on which it is based
};

// Estimates the motion of the first 40 s of a recording with the factory
// calibration, and calibrates on it: with that start, motions are right to
// millimetres instead of decimetres, and tracks to a fraction of a pixel
// instead of several, which what looks for mistakes in the data takes for
// granted. Directions of theta that these segments do not show keep their
// factory value.
//
// As a prior for a calibration on the same recording, with the tolerances of
// the factory, the start makes sigmas too small by up to 12 %, in directions
// about which the data says as much as the prior, and by nothing that matters
// in all others.
//
// NOT_FOUND with the reason if there is no motion or the calibration does not
// converge, and the errors of Odometry.
absl::StatusOr<CalibrationStart> FindStart(Recording* recording,
                                           const Rig& rig);

}  // namespace selfcal::client
