// Output of a rig.
#pragma once

#include <optional>

#include "client/cli/context.h"
#include "selfcal/v1/activity_service.pb.h"
#include "selfcal/v1/rig.pb.h"

namespace selfcal::client {

// Prints the settings and the factory calibration and, as text, the reports of
// the device if there are any.
void PrintRig(const Context& context,
              const v1::Rig& rig,
              const std::optional<v1::ReportState>& reports = std::nullopt);

}  // namespace selfcal::client
