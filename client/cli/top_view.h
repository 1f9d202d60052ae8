// What `selfcal top` shows of an answer of ActivityService; pure.
#pragma once

#include <cstdint>
#include <string>

#include "client/cli/table.h"
#include "selfcal/v1/activity_service.pb.h"

namespace selfcal::client {

// "42 s", "12 min", "3 h", "9 d"; "0 s" for what is negative.
std::string AgeText(std::int64_t seconds);

// A rig a row. Times are stamps, or with `ages` how long ago they are by the
// daemon's clock.
Table ActivityTable(const v1::ListActivityResponse& activity, bool ages);

// Lines for a terminal of this size, none of them wider, no more of them: what
// is going on in all, and below it the rigs that there is room for.
std::string ActivityScreen(const v1::ListActivityResponse& activity,
                           int columns,
                           int rows);

// Rigs that ActivityScreen has room for.
int RigsOnScreen(int rows);

}  // namespace selfcal::client
