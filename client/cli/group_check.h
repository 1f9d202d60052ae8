// Groups of parameters in conditions on segments.
#pragma once

#include <absl/status/status.h>

#include <string>
#include <vector>

#include "client/cli/context.h"

namespace selfcal::client {

inline constexpr char kSegmentFilterHelp[] =
    "Conditions joined by AND, e.g. 'state = SCORED AND gain.camera >= 2'; "
    "fields: state, session, has_data, in_table, excluded, receive_time, "
    "calibration_version, landmarks, observations, temperature_c, "
    "angular_rate, acceleration, entropy.GROUP, gain.GROUP";

// A flag and its value.
struct GivenFlag {
  std::string flag;
  std::string text;
};

// INVALID_ARGUMENT, with the groups that the rig has, if a text is a condition
// on, or orders by, a group that the rig does not have. Reads the rig only if a
// text names a group; if it cannot be read, the daemon says so when it is asked
// for the list.
absl::Status CheckGroups(const Context& context,
                         const std::string& rig,
                         const std::vector<GivenFlag>& given);

// The same for a flag whose value is a group.
absl::Status CheckGroup(const Context& context,
                        const std::string& rig,
                        const GivenFlag& given);

}  // namespace selfcal::client
