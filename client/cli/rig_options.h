// Options that override what files say about a rig.
#pragma once

#include <CLI/CLI.hpp>
#include <utility>
#include <vector>

#include "client/cli/rig_input.h"

namespace selfcal::client {

// An option, and the field of the request that it sets.
using FieldOption = std::pair<const char*, const CLI::Option*>;

// Adds --id, noise, tolerances, blocks and policy to a command; `imu_rate` is
// its option --imu-rate. `input` must outlive the command.
std::vector<FieldOption> AddRigOverrides(CLI::App* command,
                                         CLI::Option* imu_rate,
                                         RigInput* input);

}  // namespace selfcal::client
