// A SegmentQuery in SQL. One text for each order: what is not asked for is
// NULL, so that a connection keeps few statements whatever clients ask.
#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <string>

#include "server/store/statement.h"
#include "server/store/store.h"

namespace selfcal::server {

// Where a page begins: after the segment of this key and sequence.
struct SegmentPlace {
  double key = 0;
  std::int64_t sequence = 0;
};

// The list that the query makes of the rig, for tokens: different queries have
// different ones.
std::string ListName(const std::string& rig, const SegmentQuery& query);

// The place in the token of a page, or the beginning. INVALID_ARGUMENT for a
// token that is not one of this list.
absl::StatusOr<SegmentPlace> PlaceOfPage(const std::string& list,
                                         const SegmentQuery& query,
                                         const Page& page);
std::string TokenAfter(const std::string& list, const SegmentPlace& place);

// Runs `columns`, from segments `s` with their information `i`, over the rows
// of a page and one more; the last column after them is the key.
Statement SelectSegments(Connection* db,
                         const std::string& columns,
                         std::int64_t rig,
                         const SegmentQuery& query,
                         const SegmentPlace& after,
                         int limit);

}  // namespace selfcal::server
