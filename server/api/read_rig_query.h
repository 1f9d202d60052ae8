// Reads the filter and the order of a list of rigs. Internal to server/api.
#pragma once

#include <absl/status/status.h>

#include <string>

#include "server/api/call.h"
#include "server/store/rig_query.h"

namespace selfcal::server {

// Changes *query as the two texts say, and so that it selects only rigs that
// the caller may read; what the texts do not say stays. INVALID_ARGUMENT names
// the field; `filter_field` is that of the filter.
absl::Status ReadRigQuery(const Call& call,
                          const std::string& filter,
                          const std::string& order_by,
                          RigQuery* query,
                          const std::string& filter_field = "filter");

}  // namespace selfcal::server
