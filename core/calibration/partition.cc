#include "core/calibration/partition.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

namespace selfcal {
namespace {

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

void MergeInto(Observers* a, Observers&& b) {
  a->members.insert(a->members.end(), b.members.begin(), b.members.end());
  std::vector<std::uint64_t> ids;
  ids.reserve(a->landmarks.size() + b.landmarks.size());
  std::set_union(a->landmarks.begin(),
                 a->landmarks.end(),
                 b.landmarks.begin(),
                 b.landmarks.end(),
                 std::back_inserter(ids));
  a->landmarks = std::move(ids);
}

// Both segments belong to one session.
bool Joinable(const MotionSegment& before, const MotionSegment& after) {
  const std::int64_t first_ns = after.keyframes.front().t_ns;
  return before.key.index + 1 == after.key.index &&
         before.keyframes.back().t_ns < first_ns &&
         before.imu.back().t_ns >= first_ns &&
         (before.imu1.empty() || before.imu1.back().t_ns >= first_ns);
}

// 0 if a temperature is not known.
double Warming(const MotionSegment& before, const MotionSegment& after) {
  if (!before.temperature_c || !after.temperature_c) return 0;
  return std::abs(*after.temperature_c - *before.temperature_c);
}

// Appends the partitions of one session to the result.
void Finish(int merge_landmarks,
            std::vector<Observers>* parts,
            std::vector<std::vector<int>>* partitions) {
  MergeObservers(merge_landmarks, parts);
  for (Observers& part : *parts) {
    std::sort(part.members.begin(), part.members.end());
    partitions->push_back(std::move(part.members));
  }
  parts->clear();
}

}  // namespace

// Merges pairs until none exceeds the threshold. The intersection of two sets
// only grows when either grows, so that the result is unique.
void MergeObservers(int merge_landmarks, std::vector<Observers>* sets) {
  for (std::size_t i = 0; i < sets->size();) {
    bool merged = false;
    for (std::size_t j = i + 1; j < sets->size();) {
      Observers& a = (*sets)[i];
      Observers& b = (*sets)[j];
      if (CountCommon(a.landmarks, b.landmarks) > merge_landmarks) {
        MergeInto(&a, std::move(b));
        sets->erase(sets->begin() + static_cast<std::ptrdiff_t>(j));
        merged = true;
      } else {
        ++j;
      }
    }
    // The grown set may now have enough in common with sets that it did not
    // match before, including earlier ones in the list.
    i = merged ? 0 : i + 1;
  }
}

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
    const std::vector<const MotionSegment*>& segments,
    int merge_landmarks,
    double max_warming_k) {
  Partitioning result;
  result.merge_landmarks = merge_landmarks;
  // The segments of one session: other sessions have separate ids, so that
  // partitions of different sessions have nothing in common whatever their
  // numbers.
  std::vector<Observers> parts;
  int first = 0;  // of the chain of joined segments
  for (int i = 0; i < static_cast<int>(segments.size()); ++i) {
    Observers part{{i}, ObservedIds(*segments[i])};
    const bool same_session =
        i > 0 && segments[i - 1]->key.session == segments[i]->key.session;
    if (!same_session) {
      Finish(merge_landmarks, &parts, &result.partitions);
    } else if (Joinable(*segments[i - 1], *segments[i]) &&
               Warming(*segments[first], *segments[i]) <= max_warming_k) {
      result.joints.push_back({i - 1, i});
      MergeInto(&parts.back(), std::move(part));
      continue;
    } else {
      const std::int64_t dt_ns = segments[i]->keyframes.front().t_ns -
                                 segments[i - 1]->keyframes.back().t_ns;
      if (dt_ns > 0) {
        result.gaps.push_back({i - 1, i, static_cast<double>(dt_ns) * 1e-9});
      }
    }
    parts.push_back(std::move(part));
    first = i;
  }
  Finish(merge_landmarks, &parts, &result.partitions);
  std::sort(result.partitions.begin(), result.partitions.end());
  return result;
}

}  // namespace selfcal
