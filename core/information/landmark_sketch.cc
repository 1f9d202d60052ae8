#include "core/information/landmark_sketch.h"

#include <algorithm>
#include <limits>

namespace selfcal {

std::uint64_t LandmarkHash(std::uint64_t id) {
  id += 0x9e3779b97f4a7c15;
  id = (id ^ (id >> 30)) * 0xbf58476d1ce4e5b9;
  id = (id ^ (id >> 27)) * 0x94d049bb133111eb;
  return id ^ (id >> 31);
}

std::uint64_t KnownUpTo(const LandmarkSketch& sketch) {
  return sketch.entries.size() < kLandmarkSketchSize
             ? std::numeric_limits<std::uint64_t>::max()
             : LandmarkHash(sketch.entries.back().id);
}

void SketchLandmarks(const MotionSegment& segment,
                     std::span<const int> observations,
                     LandmarkSketch* sketch) {
  std::vector<LandmarkSketch::Entry>& entries = sketch->entries;
  entries.clear();
  int last = -1;
  for (const int index : observations) {
    const int landmark = segment.observations[index].landmark;
    if (landmark != last) entries.push_back({segment.landmarks[landmark].id});
    ++entries.back().observations;
    last = landmark;
  }
  const auto smaller = [](const auto& a, const auto& b) {
    return LandmarkHash(a.id) < LandmarkHash(b.id);
  };
  if (entries.size() > kLandmarkSketchSize) {
    std::nth_element(entries.begin(),
                     entries.begin() + kLandmarkSketchSize,
                     entries.end(),
                     smaller);
    entries.resize(kLandmarkSketchSize);
  }
  std::sort(entries.begin(), entries.end(), smaller);
}

}  // namespace selfcal
