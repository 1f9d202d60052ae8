#include "server/pipeline/stored_information.h"

#include <utility>

#include "server/status/status_macros.h"

namespace selfcal::server {
namespace {

constexpr int kPageSize = 100;

}  // namespace

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

absl::StatusOr<std::vector<StoredSegment>> ListKept(Store* store,
                                                    const std::string& rig) {
  SegmentQuery query;
  query.has_data = true;
  query.descending = false;
  std::vector<StoredSegment> segments;
  Page page{kPageSize, ""};
  do {
    SELFCAL_ASSIGN_OR_RETURN(Listed<StoredSegment> listed,
                             store->ListSegments(rig, query, page));
    for (StoredSegment& segment : listed.items) {
      // A segment that waits for its score has no information.
      if (segment.information) segments.push_back(std::move(segment));
    }
    page.token = listed.next_token;
  } while (!page.token.empty());
  return segments;
}

}  // namespace selfcal::server
