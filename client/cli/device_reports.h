// The reports of a device about one of its rigs, as a hub knows them.
#pragma once

#include <optional>
#include <string>

#include "client/cli/context.h"
#include "selfcal/v1/activity_service.pb.h"

namespace selfcal::client {

// nullopt if no device reports the rig, or if the daemon does not say so.
std::optional<v1::ReportState> ReadDeviceReports(const Context& context,
                                                 const std::string& rig);

}  // namespace selfcal::client
