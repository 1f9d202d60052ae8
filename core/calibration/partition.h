// How a set of segments hangs together (section IV-C of the paper): direct
// neighbours in time are joined by the IMU samples between them, what sees
// enough common landmarks is merged (Alg. 2), and between what remains apart in
// one session the biases still walk.
//
// Pure functions of their arguments, callable from any thread.
#pragma once

#include <cstdint>
#include <vector>

#include "core/model/segment.h"

namespace selfcal {

// Segments are named by their index into the list that was partitioned.
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
  // Sets of segments that are disjoint; each sorted, and sorted by their first.
  std::vector<std::vector<int>> partitions;
  std::vector<SegmentJoint> joints;
  std::vector<SegmentGap> gaps;
  int merge_landmarks = 0;  // as it was asked for
};

// What observes landmarks: segments, or chains of keyframes.
struct Observers {
  std::vector<int> members;
  std::vector<std::uint64_t> landmarks;  // ids, sorted, distinct
};

// Merges sets of one session while two of them observe more than
// merge_landmarks common ids.
void MergeObservers(int merge_landmarks, std::vector<Observers>* sets);

// The segments in the order of their keys, on which everything else works, so
// that no result depends on the order in which they were handed over. The
// pointers live as long as `segments`.
std::vector<const MotionSegment*> SortByKey(
    const std::vector<MotionSegment>& segments);

// Partitions segments sorted by key. Two segments are joined if they are of one
// session, their indices follow each other, and the samples of the first reach
// to the first keyframe of the second. Partitions of one session are merged
// while two of them observe more than merge_landmarks common ids, counted over
// the whole of each: unlike a single pass over the segments, that has one
// outcome whatever the order, and leaves no two partitions over the threshold.
Partitioning PartitionSegments(
    const std::vector<const MotionSegment*>& segments, int merge_landmarks);

}  // namespace selfcal
