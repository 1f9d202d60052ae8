// The landmarks of a segment in a size that can be kept for every segment ever
// scored: the 256 of smallest hash. The sample is drawn in the same way for all
// segments, so that the overlap of two segments can be estimated from their
// sketches (bottom-k sketch, Cohen and Kaplan 2007). The sketch of a segment
// with fewer landmarks is complete; for a larger one, shares have a standard
// error of at most 3 % (1 / (2 sqrt(256))).
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

// A one-to-one hash that removes any structure of the ids (the finaliser of
// splitmix64, Steele, Lea and Flood 2014).
std::uint64_t LandmarkHash(std::uint64_t id);

// Largest hash up to which the sketch contains every landmark of the segment.
std::uint64_t KnownUpTo(const LandmarkSketch& sketch);

// Sketches the landmarks of the observations that were used: indices into
// segment.observations, with those of a landmark consecutive. Reuses the memory
// of *sketch.
void SketchLandmarks(const MotionSegment& segment,
                     std::span<const int> observations,
                     LandmarkSketch* sketch);

}  // namespace selfcal
