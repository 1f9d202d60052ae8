// A SegmentQuery in SQL. There is one text for each order, and filters that are
// not set are NULL, so that a connection keeps few statements whatever clients
// ask for.
#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <string>

#include "server/store/driver/statement.h"
#include "server/store/store.h"

namespace selfcal::server {

// The position of a page: it begins after the segment with this key and
// sequence.
struct SegmentPlace {
  double key = 0;
  std::int64_t sequence = 0;
};

// Name of the list of the rig for page tokens; different queries have different
// names.
std::string ListName(const std::string& rig, const SegmentQuery& query);

// The position in the token of a page, or the beginning of the list.
// INVALID_ARGUMENT for a token of another list.
absl::StatusOr<SegmentPlace> PlaceOfPage(const std::string& list,
                                         const SegmentQuery& query,
                                         const Page& page);
std::string TokenAfter(const std::string& list, const SegmentPlace& place);

// Selects `columns` of segments `s` and their information `i`, for at most
// `limit` rows after the position. The key follows as the last column.
Statement SelectSegments(Connection* db,
                         const std::string& columns,
                         std::int64_t rig,
                         const SegmentQuery& query,
                         const SegmentPlace& after,
                         int limit);

}  // namespace selfcal::server
