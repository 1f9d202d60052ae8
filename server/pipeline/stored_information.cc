#include "server/pipeline/stored_information.h"

#include <utility>

#include "server/store/status_macros.h"

namespace selfcal::server {

absl::StatusOr<std::vector<SegmentInformation>> ListInformation(
    Store* store,
    const std::string& rig,
    std::span<const SegmentKey> segments) {
  std::vector<SegmentInformation> list;
  for (const SegmentKey& key : segments) {
    auto segment = store->GetSegment(rig, key);
    if (absl::IsDataLoss(segment.status())) continue;
    SELFCAL_RETURN_IF_ERROR(segment.status());
    if (segment->information) {
      list.push_back(*std::move(segment->information));
    }
  }
  return list;
}

}  // namespace selfcal::server
