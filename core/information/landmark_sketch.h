// Which landmarks a segment sees, in a size that can be kept for every segment
// ever scored: the 256 of smallest hash, a sample that is drawn alike for all
// segments, so that the overlap of two can be told from their sketches
// (bottom-k sketch, Cohen and Kaplan 2007). A segment with fewer landmarks is
// known entirely; of a larger one, shares are known with a standard error of at
// most 3 % (1 / (2 sqrt(256))).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/model/segment.h"

namespace selfcal {

inline constexpr int kLandmarkSketchSize = 256;

struct LandmarkSketch {
  struct Entry {
    std::uint64_t id = 0;  // unique within the session
    std::int32_t observations = 0;

    friend bool operator==(const Entry&, const Entry&) = default;
  };
  std::vector<Entry> entries;  // by LandmarkHash(id), ascending

  friend bool operator==(const LandmarkSketch&,
                         const LandmarkSketch&) = default;
};

// One-to-one, and without structure where ids have one (the finaliser of
// splitmix64, Steele, Lea and Flood 2014).
std::uint64_t LandmarkHash(std::uint64_t id);

// The hash up to which the sketch holds every landmark of the segment.
std::uint64_t KnownUpTo(const LandmarkSketch& sketch);

// Of the observations that were used: indices into segment.observations, those
// of a landmark in one run. Keeps the memory of *sketch.
void SketchLandmarks(const MotionSegment& segment,
                     std::span<const int> observations,
                     LandmarkSketch* sketch);

}  // namespace selfcal
