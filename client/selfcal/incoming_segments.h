// The segments that the SLAM system has handed over and that are not encoded
// yet, oldest first, with the one that the keeper works on. It guarantees the
// bound of the queue: a segment is accepted only if, with those that the queue
// holds elsewhere, no more than max_queue are in memory.
//
// Not thread-safe: SegmentQueue guards it.
#pragma once

#include <cstddef>
#include <deque>
#include <optional>

#include "client/selfcal/encoded_segment.h"

namespace selfcal::client {

class IncomingSegments {
 public:
  explicit IncomingSegments(std::size_t max_in_memory)
      : max_in_memory_(max_in_memory) {}

  // Returns false, and leaves the segment as it is, if there is no room besides
  // the `elsewhere` segments in other places of the queue, or no memory.
  bool Push(UnencodedSegment&& segment, std::size_t elsewhere) noexcept;
  // True if there is room for one more segment besides those `elsewhere`.
  bool HasRoom(std::size_t elsewhere) const {
    return size() + elsewhere < max_in_memory_;
  }

  // Hands out the oldest segment. It counts until Release; only one is handed
  // out at a time. nullopt if there is none.
  std::optional<UnencodedSegment> Take();
  // The segment that was handed out is elsewhere now, or gone.
  void Release() { taken_ = false; }

  std::size_t waiting() const { return waiting_.size(); }
  // Those that wait and the one that is handed out.
  std::size_t size() const { return waiting_.size() + (taken_ ? 1 : 0); }

 private:
  const std::size_t max_in_memory_;
  std::deque<UnencodedSegment> waiting_;
  bool taken_ = false;
};

}  // namespace selfcal::client
