// The rig that a recording is fed to: with the calibration of a tool's files,
// what the recording states, or a guess; and tolerances for a device of which
// no more is known.
#pragma once

#include <absl/status/statusor.h>

#include <span>
#include <string>
#include <vector>

#include "client/cli/recorded_sessions.h"
#include "client/cli/rig_input.h"
#include "client/odometry/start.h"
#include "core/model/camera.h"
#include "selfcal/v1/rig.pb.h"

namespace selfcal::client {

// Median rate of readings [Hz].
double ImuRate(std::span<const ImuSample> imu);

struct RecordedRig {
  v1::Rig rig;
  std::vector<UnknownOfCamera> unknown;  // for each camera
};

// Prior sigmas, unless the input states others: 5 % of the focal length, 2 % of
// the image's width for the principal point, 3 degrees, 5 cm, and 50 ms for the
// time offset, which is estimated unless the input switches it off. `from` has
// the tool and its files, or nothing: then the calibration is what the
// recording states, or that of a map. A camera without one is guessed: of the
// model `guessed`, as that is usual, with a focal length from the width of the
// image, to 30 %; one without a pose is in the IMU, to 10 cm. Errors are those
// of ReadRig and of images.
absl::StatusOr<RecordedRig> ReadRecordedRig(
    RigInput input,
    const std::vector<std::string>& from,
    DistortionModel guessed,
    const RecordedSession& session,
    std::vector<Loss>* losses);

}  // namespace selfcal::client
