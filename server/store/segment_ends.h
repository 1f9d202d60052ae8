// Records of the ends of segments (core/information/segment_ends.h), which
// remain when the data is gone.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/information/segment_ends.h"
#include "server/store/exclusions.h"
#include "server/store/segment_rows.h"
#include "server/store/unit_of_work.h"

namespace selfcal::server {

std::string SerializeEnds(const SegmentEnds& ends);
// DATA_LOSS for bytes that are not such a record.
absl::StatusOr<SegmentEnds> ParseEnds(std::string_view bytes);

// --- Within a unit of work.

// A scored segment that has ends.
struct EndsRow {
  SegmentRow segment;
  bool has_data = false;
  // Read only for segments without data; nullopt if the record is damaged.
  std::optional<SegmentEnds> ends = std::nullopt;
};
// The scored segments with ends, from this sequence on, without those that a
// table does not hold for one of these causes: sessions in the order in which
// they began, each by index.
absl::StatusOr<std::vector<EndsRow>> ReadEnds(UnitOfWork* tx,
                                              std::int64_t first_sequence,
                                              ExclusionCauses not_excluded_for);
// Arrival times of the scored segments that have ends [ns since the Unix
// epoch].
absl::StatusOr<std::vector<std::int64_t>> ArrivalsOfEnds(UnitOfWork* tx);
// Sequences of the segments that have ends but no data, newest first.
absl::StatusOr<std::vector<std::int64_t>> EndsWithoutData(UnitOfWork* tx);

// Replaces the ends that the segment had.
absl::Status WriteEnds(UnitOfWork* tx,
                       std::int64_t sequence,
                       const SegmentEnds& ends);
absl::Status DeleteEnds(UnitOfWork* tx, std::int64_t sequence);
absl::Status DeleteEndsBefore(UnitOfWork* tx, std::int64_t first_sequence);

}  // namespace selfcal::server
