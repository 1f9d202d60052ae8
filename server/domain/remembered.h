// What is known of segments besides the data that a run calibrates on.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <vector>

#include "core/calibration/remembered_segment.h"
#include "core/information/segment_ends.h"
#include "core/information/segment_information.h"
#include "server/store/unit_of_work.h"

namespace selfcal::server {

// Number of the newest segments without data whose ends are kept.
inline constexpr int kRemembered = 256;

// The reserve: number of the newest scored segments in no table whose data is
// kept, to validate candidates on.
inline constexpr int kReserve = 4;

// A segment on which a candidate is validated.
struct HeldOut {
  SegmentKey key;
  bool has_data = false;
  SegmentInformation information;
};

// Writes the ends of a segment, and deletes the oldest of those without data
// beyond kRemembered.
absl::Status Remember(UnitOfWork* tx,
                      std::int64_t segment,
                      const SegmentEnds& ends);

// Domain::ListRemembered.
absl::StatusOr<std::vector<RememberedSegment>> ListRemembered(UnitOfWork* tx,
                                                              std::int64_t run);

// Domain::ListHeldOut.
absl::StatusOr<std::vector<HeldOut>> ListHeldOut(UnitOfWork* tx,
                                                 std::int64_t run,
                                                 int limit);

}  // namespace selfcal::server
