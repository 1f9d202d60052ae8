// Reading of stored information of segments.
#pragma once

#include <absl/status/statusor.h>

#include <span>
#include <string>
#include <vector>

#include "core/information/segment_information.h"
#include "core/model/segment.h"
#include "server/store/store.h"

namespace selfcal::server {

// The information of the segments, in the order of the keys; those that are not
// scored, or are damaged, have none. Errors of the store.
absl::StatusOr<std::vector<SegmentInformation>> ListInformation(
    Store* store, const std::string& rig, std::span<const SegmentKey> segments);

// The scored segments whose data is kept, in order of arrival. Errors of the
// store.
absl::StatusOr<std::vector<StoredSegment>> ListKept(Store* store,
                                                    const std::string& rig);

}  // namespace selfcal::server
