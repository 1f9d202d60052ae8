// Parsers of the filter and the order of a list of segments
// (ListSegmentsRequest in selfcal/v1/segment.proto has the grammar).
#pragma once

#include <absl/status/statusor.h>

#include <string_view>

#include "server/store/segment_query.h"

namespace selfcal::server {

// INVALID_ARGUMENT names the position and what was expected.
absl::Status ParseSegmentFilter(std::string_view filter, SegmentQuery* query);
absl::Status ParseSegmentOrder(std::string_view order_by, SegmentQuery* query);

}  // namespace selfcal::server
