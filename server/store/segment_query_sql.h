// A SegmentQuery in SQL.
#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <optional>
#include <string>

#include "server/store/driver/sql_condition.h"
#include "server/store/driver/statement.h"
#include "server/store/store.h"

namespace selfcal::server {

// The position of a page: it begins after the segment with this key, arrival
// (in a list by arrival of all rigs), key of the rig, and sequence.
struct SegmentPlace {
  double key = 0;
  std::int64_t steady_ns = 0;
  std::int64_t rig = 0;
  std::int64_t sequence = 0;
};

// Name of the list for page tokens, of one rig or, if `rig` is empty, of those
// of `rigs`; different queries have different names.
std::string ListName(const std::string& rig,
                     const SegmentQuery& query,
                     const RigQuery& rigs);

// OK if the segments of all rigs can be sorted like that: by an index, so that
// a page is read without the others. INVALID_ARGUMENT names these orders.
absl::Status CheckOrderOfAll(const SegmentQuery& query);

// The position in the token of a page; nullopt: the beginning of the list.
// INVALID_ARGUMENT for a token of another list.
absl::StatusOr<std::optional<SegmentPlace>> PlaceOfPage(const std::string& list,
                                                        const Page& page);
std::string TokenAfter(const std::string& list, const SegmentPlace& place);

// Selects the places of segments, at most `limit` after the position, if there
// is one: of the rig with this key or, if it is 0, of those of `rigs`. The
// parameters of the text are those of *condition, which must be new. A place
// has only what the index of the order has, so that it is read alone.
std::string SelectPlaces(std::int64_t rig,
                         const SegmentQuery& query,
                         const RigQuery& rigs,
                         const std::optional<SegmentPlace>& after,
                         int limit,
                         SqlCondition* condition);
// A row of that statement.
SegmentPlace PlaceOfRow(std::int64_t rig,
                        const SegmentQuery& query,
                        const Statement& row);

}  // namespace selfcal::server
