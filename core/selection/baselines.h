// Other selections of the same size, for comparison: each is a table with
// another score, so that all can process a stream, and all give the same set
// for the same segments.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/information/segment_information.h"
#include "core/model/rig.h"
#include "core/selection/tables.h"

namespace selfcal {

// `information` must outlive the call.
struct ScoredSegment {
  SegmentKey key;
  std::int64_t sequence = 0;
  const SegmentInformation* information = nullptr;
};

// All of these offer the segments in their order, and use the rig's minimum
// gain.

// The tables of the paper.
std::vector<Table> MostInformativeTables(
    const Rig& rig, std::span<const ScoredSegment> segments);

// The segments of highest entropy; the table contains the negated entropy.
std::vector<Table> LeastInformativeTables(
    const Rig& rig, std::span<const ScoredSegment> segments);

// One table for all of theta.
Table SingleGroupTable(const Rig& rig,
                       int capacity,
                       std::span<const ScoredSegment> segments);

// A table in which every subset of that size has the same probability, over the
// seeds: the score is a hash of seed and key (a reservoir by random keys,
// Vitter 1985).
Table RandomTable(const Rig& rig,
                  int capacity,
                  std::uint64_t seed,
                  std::span<const ScoredSegment> segments);

}  // namespace selfcal
