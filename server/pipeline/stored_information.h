// What segments show, as it is stored.
#pragma once

#include <absl/status/statusor.h>

#include <span>
#include <string>
#include <vector>

#include "core/information/segment_information.h"
#include "core/model/segment.h"
#include "server/store/store.h"

namespace selfcal::server {

// In the order of the keys; of segments that are not scored, or damaged, there
// is none. Errors of the store.
absl::StatusOr<std::vector<SegmentInformation>> ListInformation(
    Store* store, const std::string& rig, std::span<const SegmentKey> segments);

// The scored segments that have their data, in order of arrival. Errors of the
// store.
absl::StatusOr<std::vector<StoredSegment>> ListKept(Store* store,
                                                    const std::string& rig);

}  // namespace selfcal::server
