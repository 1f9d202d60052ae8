// Parsers of the filter and the order of a list of runs
// (ListRecalibrationsRequest in selfcal/v1/recalibration.proto has the
// grammar).
#pragma once

#include <absl/status/status.h>

#include <string_view>

#include "server/store/run_query.h"

namespace selfcal::server {

// INVALID_ARGUMENT names the position and what was expected.
absl::Status ParseRunFilter(std::string_view filter, RunQuery* query);
absl::Status ParseRunOrder(std::string_view order_by, RunQuery* query);

}  // namespace selfcal::server
