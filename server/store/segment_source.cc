#include "server/store/segment_source.h"

#include <utility>

#include "server/status/status_macros.h"

namespace selfcal::server {

absl::StatusOr<std::vector<MotionSegment>> ReadAll(
    const SegmentSource& source) {
  std::vector<MotionSegment> segments;
  for (;;) {
    SELFCAL_ASSIGN_OR_RETURN(std::optional<MotionSegment> segment, source());
    if (!segment) return segments;
    segments.push_back(*std::move(segment));
  }
}

}  // namespace selfcal::server
