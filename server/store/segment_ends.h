// What segments say together with the states at their ends, in the database:
// what is remembered of them when their data is gone.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "core/calibration/remembered_segment.h"
#include "core/information/segment_ends.h"
#include "server/store/statement.h"

namespace selfcal::server {

std::string SerializeEnds(const SegmentEnds& ends);
// DATA_LOSS for bytes that are not what they should be.
absl::StatusOr<SegmentEnds> ParseEnds(std::string_view bytes);

// Store::ListRemembered.
absl::StatusOr<std::vector<RememberedSegment>> ListRememberedRows(
    Connection* db, const std::string& rig, std::int64_t run);

// The rest runs inside a transaction of the caller.

// In place of what was remembered of the segment. Forgets the oldest of the
// rig's segments without data beyond Store::kRemembered.
absl::Status WriteEnds(Connection* db,
                       std::int64_t rig,
                       std::int64_t segment,
                       const SegmentEnds& ends);

absl::Status ForgetSegment(Connection* db, std::int64_t segment);
absl::Status ForgetBefore(Connection* db,
                          std::int64_t rig,
                          std::int64_t first_sequence);

}  // namespace selfcal::server
