// The output of `selfcal daemon top` for a response of ActivityService. Pure
// functions.
#pragma once

#include <cstdint>
#include <string>

#include "client/cli/table.h"
#include "selfcal/v1/activity_service.pb.h"

namespace selfcal::client {

// Returns "42 s", "12 min", "3 h" or "9 d"; "0 s" for negative values.
std::string AgeText(std::int64_t seconds);

// A table with one rig per row. Times are timestamps or, with `ages`, ages by
// the daemon's clock.
Table ActivityTable(const v1::ListActivityResponse& activity, bool ages);

// Lines that fit into a terminal of this size: totals, and below them as many
// rigs as there is room for.
std::string ActivityScreen(const v1::ListActivityResponse& activity,
                           int columns,
                           int rows);

// Number of rigs that ActivityScreen has room for.
int RigsOnScreen(int rows);

}  // namespace selfcal::client
