// Reads the filter and the order of a list of rigs. Internal to server/api.
#pragma once

#include <absl/status/status.h>

#include <string>

#include "server/store/rig_query.h"

namespace selfcal::server {

// Changes *query as the two texts say; what they do not say stays.
// INVALID_ARGUMENT names the field.
absl::Status ReadRigQuery(const std::string& filter,
                          const std::string& order_by,
                          RigQuery* query);

}  // namespace selfcal::server
