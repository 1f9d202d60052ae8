// Parses the filter and the order of a list of rigs from text
// (ListRigsRequest in selfcal/v1/rig.proto has the grammar).
#pragma once

#include <absl/status/status.h>

#include <string_view>

#include "server/store/rig_query.h"

namespace selfcal::server {

// INVALID_ARGUMENT says where and what was expected.
absl::Status ParseRigFilter(std::string_view filter, RigQuery* query);
absl::Status ParseRigOrder(std::string_view order_by, RigQuery* query);

}  // namespace selfcal::server
