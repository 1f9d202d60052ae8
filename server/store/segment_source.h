// Segments that are needed one after the other, so that no more than one of
// them is in memory at a time.
#pragma once

#include <absl/status/statusor.h>

#include <functional>
#include <optional>
#include <vector>

#include "core/model/segment.h"

namespace selfcal::server {

// Returns the next segment, nullopt after the last, or why the next cannot be
// read; is not called again after either.
using SegmentSource =
    std::function<absl::StatusOr<std::optional<MotionSegment>>()>;

// For a caller that needs all of them at once.
absl::StatusOr<std::vector<MotionSegment>> ReadAll(const SegmentSource& source);

}  // namespace selfcal::server
