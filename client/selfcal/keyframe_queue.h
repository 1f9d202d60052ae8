// The keyframes that are in no complete segment yet: those of the current
// segment and, while IMU samples lag behind, of later ones.
//
// Not thread-safe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "client/selfcal/closed_segment.h"
#include "client/selfcal/pending_keyframe.h"

namespace selfcal::client {

// The size at which a segment is full.
struct SegmentSize {
  int keyframes = 40;  // at least 2 ...
  // ... or, if it is set, the duration of a segment instead.
  std::optional<std::uint64_t> duration_ns;
};

class KeyframeQueue {
 public:
  explicit KeyframeQueue(const SegmentSize& segment) : segment_(segment) {}

  // Adds one that is later than all others. Throws std::bad_alloc.
  void Add(PendingKeyframe keyframe);

  bool empty() const { return keyframes_.empty(); }
  std::size_t size() const { return keyframes_.size(); }
  const PendingKeyframe& front() const { return keyframes_.front(); }
  const PendingKeyframe& back() const { return keyframes_.back(); }
  const PendingKeyframe& operator[](std::size_t i) const {
    return keyframes_[i];
  }

  // Number of keyframes of the segment that starts with the first keyframe, if
  // the keyframe after the segment has arrived. 1 if that has another version.
  std::optional<std::size_t> ClosedSize() const;
  // Time to which samples are needed for a segment of the first n keyframes: it
  // is joined with the keyframe after it.
  std::int64_t EndOf(std::size_t n) const;

  // Moves the first n to the end of `segment`, which has the capacity.
  void Release(std::size_t n, std::vector<ObservedKeyframe>* segment);

  // These return the number of keyframes that they drop.
  std::size_t DropFirst(std::size_t n);
  // Drops those before the first one whose samples begin at the time or later.
  std::size_t DropBefore(std::int64_t t_ns);
  std::size_t DropAll() { return DropFirst(keyframes_.size()); }
  std::size_t Free();  // drops all, with their memory

 private:
  // True if the first n keyframes make a segment, given the one after them.
  bool IsFull(std::size_t n) const;

  SegmentSize segment_;
  std::vector<PendingKeyframe> keyframes_;
};

}  // namespace selfcal::client
