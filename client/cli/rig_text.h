// Output of a rig.
#pragma once

#include "client/cli/context.h"
#include "selfcal/v1/rig.pb.h"

namespace selfcal::client {

// Prints the settings and the factory calibration.
void PrintRig(const Context& context, const v1::Rig& rig);

}  // namespace selfcal::client
