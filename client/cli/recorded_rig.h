// The rig that a recording is fed to: with the calibration of a tool's files,
// or what the recording states, and tolerances for a device of which no more is
// known.
#pragma once

#include <absl/status/statusor.h>

#include <string>
#include <vector>

#include "client/cli/rig_input.h"
#include "client/recording/recording.h"
#include "selfcal/v1/rig.pb.h"

namespace selfcal::client {

// Median rate of the readings [Hz].
double ImuRate(const Recording& recording);

// Prior sigmas, unless the input states others: 5 % of the focal length, 2 % of
// the image's width for the principal point, 3 degrees, 5 cm, and 50 ms for the
// time offset, which is estimated unless the input switches it off. `from` has
// the tool and its files, or nothing. INVALID_ARGUMENT if the recording does
// not state what is needed then, with what to do.
absl::StatusOr<v1::Rig> ReadRecordedRig(RigInput input,
                                        const std::vector<std::string>& from,
                                        const Recording& recording,
                                        std::vector<Loss>* losses);

}  // namespace selfcal::client
