// A start for the calibration of a device of which little is known, from its
// recording itself.
#pragma once

#include <absl/status/statusor.h>

#include <optional>
#include <vector>

#include "client/recording/recording.h"
#include "core/model/calibration.h"
#include "core/model/rig.h"

namespace selfcal::client {

// Parts of a camera that are unknown, beyond the tolerances of a rig.
struct UnknownOfCamera {
  bool rotation = false;  // q_CI may be any
  bool focal = false;     // f is a guess from the size of the image
};

struct CalibrationStart {
  Calibration theta;
  int segments = 0;  // on which it is based
};

// Compares the rotations of each camera with those of the gyroscope over the
// first 20 s of a recording (core/initialisation): for the time offset and, as
// far as `unknown` says so, its rotation and focal length. Then estimates the
// motion of the first 40 s, and calibrates on it: with that start, motions are
// right to millimetres instead of decimetres, and tracks to a fraction of a
// pixel instead of several, which what looks for mistakes in the data takes for
// granted. Directions of theta that these segments do not show keep their
// factory value.
//
// The start, as a prior for a calibration on the same recording with the
// tolerances of the factory, makes sigmas too small by up to 12 %, in
// directions about which the data says as much as the prior, and by nothing
// that matters in all others.
//
// `unknown` has an entry for each camera; the temperature [deg C] is that of
// the recording, if it is known. NOT_FOUND with the reason if there is
// no motion, the rotation of a camera is not found or the calibration does not
// converge, and the errors of Odometry.
absl::StatusOr<CalibrationStart> FindStart(
    Recording* recording,
    const Rig& rig,
    const std::vector<UnknownOfCamera>& unknown,
    std::optional<double> temperature_c = std::nullopt);

}  // namespace selfcal::client
