#include "core/calibration/partition.h"

#include <algorithm>
#include <cstdint>
#include <utility>

namespace selfcal {
namespace {

// A partition in the making. A session has ids of its own, so that partitions
// of different sessions have nothing in common whatever their numbers.
struct Part {
  std::vector<int> segments;
  std::vector<std::uint64_t> observed;  // landmark ids, sorted, distinct
};

std::vector<std::uint64_t> ObservedIds(const MotionSegment& segment) {
  std::vector<std::uint64_t> ids;
  ids.reserve(segment.observations.size());
  for (const Observation& observation : segment.observations) {
    ids.push_back(segment.landmarks[observation.landmark].id);
  }
  std::sort(ids.begin(), ids.end());
  ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
  return ids;
}

int CountCommon(const std::vector<std::uint64_t>& a,
                const std::vector<std::uint64_t>& b) {
  int count = 0;
  for (auto i = a.begin(), j = b.begin(); i != a.end() && j != b.end();) {
    if (*i < *j) {
      ++i;
    } else if (*j < *i) {
      ++j;
    } else {
      ++count, ++i, ++j;
    }
  }
  return count;
}

void MergeInto(Part* a, Part&& b) {
  a->segments.insert(a->segments.end(), b.segments.begin(), b.segments.end());
  std::vector<std::uint64_t> ids;
  ids.reserve(a->observed.size() + b.observed.size());
  std::set_union(a->observed.begin(),
                 a->observed.end(),
                 b.observed.begin(),
                 b.observed.end(),
                 std::back_inserter(ids));
  a->observed = std::move(ids);
}

bool Joinable(const MotionSegment& before, const MotionSegment& after) {
  const std::int64_t first_ns = after.keyframes.front().t_ns;
  return before.key.session == after.key.session &&
         before.key.index + 1 == after.key.index &&
         before.keyframes.back().t_ns < first_ns &&
         before.imu.back().t_ns >= first_ns;
}

// Merges pairs until none is over the threshold. What two partitions have in
// common only grows when either grows, so the outcome is unique.
void MergeByLandmarks(const std::vector<const MotionSegment*>& segments,
                      int merge_landmarks,
                      std::vector<Part>* parts) {
  const auto session = [&](const Part& part) -> const std::string& {
    return segments[part.segments.front()]->key.session;
  };
  for (std::size_t i = 0; i < parts->size();) {
    bool merged = false;
    for (std::size_t j = i + 1; j < parts->size();) {
      Part& a = (*parts)[i];
      Part& b = (*parts)[j];
      if (session(a) == session(b) &&
          CountCommon(a.observed, b.observed) > merge_landmarks) {
        MergeInto(&a, std::move(b));
        parts->erase(parts->begin() + static_cast<std::ptrdiff_t>(j));
        merged = true;
      } else {
        ++j;
      }
    }
    // The grown partition may now reach those that it did not reach before,
    // also those that stand before it in the list.
    i = merged ? 0 : i + 1;
  }
}

}  // namespace

std::vector<const MotionSegment*> SortByKey(
    const std::vector<MotionSegment>& segments) {
  std::vector<const MotionSegment*> sorted;
  sorted.reserve(segments.size());
  for (const MotionSegment& segment : segments) {
    sorted.push_back(&segment);
  }
  std::sort(sorted.begin(),
            sorted.end(),
            [](const MotionSegment* a, const MotionSegment* b) {
              return a->key < b->key;
            });
  return sorted;
}

Partitioning PartitionSegments(
    const std::vector<const MotionSegment*>& segments, int merge_landmarks) {
  Partitioning result;
  std::vector<Part> parts;
  for (int i = 0; i < static_cast<int>(segments.size()); ++i) {
    Part part{{i}, ObservedIds(*segments[i])};
    if (i > 0 && Joinable(*segments[i - 1], *segments[i])) {
      result.joints.push_back({i - 1, i});
      MergeInto(&parts.back(), std::move(part));
      continue;
    }
    if (i > 0 && segments[i - 1]->key.session == segments[i]->key.session) {
      const std::int64_t dt_ns = segments[i]->keyframes.front().t_ns -
                                 segments[i - 1]->keyframes.back().t_ns;
      if (dt_ns > 0) {
        result.gaps.push_back({i - 1, i, static_cast<double>(dt_ns) * 1e-9});
      }
    }
    parts.push_back(std::move(part));
  }
  MergeByLandmarks(segments, merge_landmarks, &parts);
  for (Part& part : parts) {
    std::sort(part.segments.begin(), part.segments.end());
    result.partitions.push_back(std::move(part.segments));
  }
  std::sort(result.partitions.begin(), result.partitions.end());
  return result;
}

}  // namespace selfcal
