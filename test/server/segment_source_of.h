// The segments of a test as the server reads them, one at a time.
#pragma once

#include <optional>
#include <utility>
#include <vector>

#include "core/model/segment.h"
#include "server/store/segment_source.h"

namespace selfcal::server {

inline SegmentSource SourceOf(std::vector<MotionSegment> segments) {
  return [segments = std::move(segments), next = std::size_t{0}]() mutable
         -> absl::StatusOr<std::optional<MotionSegment>> {
    if (next == segments.size()) return std::nullopt;
    return segments[next++];
  };
}

}  // namespace selfcal::server
