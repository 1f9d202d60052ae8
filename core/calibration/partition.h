// Partitions of a set of segments (section IV-C of the paper): direct
// neighbours in time are joined by the IMU samples between them, segments that
// observe enough common landmarks are merged (Alg. 2), and between unconnected
// segments of one session the biases are linked by a random walk.
//
// Pure functions of their arguments, callable from any thread.
#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "core/model/segment.h"

namespace selfcal {

// Segments are identified by their index into the partitioned list.
struct SegmentJoint {
  int before = 0;
  int after = 0;  // follows directly, in the same session

  friend bool operator==(const SegmentJoint&, const SegmentJoint&) = default;
};

struct SegmentGap {
  int before = 0;
  int after = 0;    // next in the set in the same session, but not joined
  double dt_s = 0;  // from the last keyframe before to the first after, > 0

  friend bool operator==(const SegmentGap&, const SegmentGap&) = default;
};

struct Partitioning {
  // Disjoint sets of segments; each sorted, and sorted by their first.
  std::vector<std::vector<int>> partitions;
  std::vector<SegmentJoint> joints;
  std::vector<SegmentGap> gaps;
  int merge_landmarks = 0;  // the threshold that was requested
};

// Observers of landmarks: segments, or chains of keyframes.
struct Observers {
  std::vector<int> members;
  std::vector<std::uint64_t> landmarks;  // ids, sorted, distinct
};

// Merges sets of one session as long as two of them observe more than
// merge_landmarks common ids.
void MergeObservers(int merge_landmarks, std::vector<Observers>* sets);

// Sorts the segments by key. All other code uses this order, so that no result
// depends on the order of the input. The pointers live as long as `segments`.
std::vector<const MotionSegment*> SortByKey(
    const std::vector<MotionSegment>& segments);

// Partitions segments sorted by key. Two segments are joined if they belong to
// one session, their indices are consecutive, the samples of the first, of both
// IMUs, extend to the first keyframe of the second, and the device is not
// warmer or colder by more than `max_warming_k` than at the first of those that
// are joined already: joined segments share one theta. Partitions of one
// session are merged as long as two of them observe more than merge_landmarks
// common ids, counted over each whole partition: unlike a single pass over the
// segments, that has one result whatever the order, and leaves no two
// partitions over the threshold.
Partitioning PartitionSegments(
    const std::vector<const MotionSegment*>& segments,
    int merge_landmarks,
    double max_warming_k = std::numeric_limits<double>::infinity());

}  // namespace selfcal
