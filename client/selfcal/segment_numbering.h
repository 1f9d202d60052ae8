// The indices of the segments of a session. The daemon joins a segment to the
// one with the index before it, if that has samples up to its first keyframe:
// an index is left out where the two do not follow each other.
#pragma once

#include <cstdint>
#include <optional>

namespace selfcal::client {

class SegmentNumbering {
 public:
  explicit SegmentNumbering(std::int64_t first_index) : next_(first_index) {}

  // Least index of the next segment.
  std::int64_t next() const { return next_; }

  // Index of the next segment, given its first keyframe.
  std::int64_t IndexFrom(std::int64_t first_ns) const {
    const bool seems_to_follow =
        reach_ns_ && *reach_ns_ >= first_ns && successor_ns_ != first_ns;
    return next_ + (seems_to_follow ? 1 : 0);
  }

  // Adds a segment with the times of its last sample, and of the keyframe that
  // follows it, if that has arrived.
  void Add(std::int64_t index,
           std::int64_t reach_ns,
           std::optional<std::int64_t> successor_ns) {
    next_ = index + 1;
    reach_ns_ = reach_ns;
    successor_ns_ = successor_ns;
  }

 private:
  std::int64_t next_;
  // Times of the newest segment, as Add has them.
  std::optional<std::int64_t> reach_ns_;
  std::optional<std::int64_t> successor_ns_;
};

}  // namespace selfcal::client
