// The segments that the sender works on, oldest first. The first in_flight of
// them have been sent on the present connection; a new connection starts over
// with the oldest. It guarantees that
//
//  - segments are sent in the order in which they were appended, each once on a
//    connection,
//  - no more than max_unacknowledged are in flight,
//  - a segment leaves only when it is acknowledged after it was sent on this
//    connection, or when it is taken out.
//
// Not thread-safe: SegmentQueue guards it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>

#include "client/selfcal/encoded_segment.h"

namespace selfcal::client {

class SendWindow {
 public:
  explicit SendWindow(std::size_t max_unacknowledged)
      : max_unacknowledged_(max_unacknowledged) {}

  // Appends the newest segment. If it throws std::bad_alloc, the segment is
  // unchanged.
  void Append(EncodedSegment&& segment);

  // Starts a connection, on which everything is sent (again).
  void Open();
  void Close() { open_ = false; }
  bool open() const { return open_; }

  // True if the connection is open and the next segment may be sent.
  bool CanSend() const;
  // Returns the next request, which is in flight from now on. Needs CanSend.
  std::shared_ptr<const v1::StreamSegmentsRequest> Next();

  // Removes a segment in flight; nullopt if there is none with this key.
  std::optional<EncodedSegment> Acknowledge(const SegmentKey& key);
  // Removes the oldest segment, at the end; nullopt if there is none.
  std::optional<EncodedSegment> TakeOldest();

  std::size_t size() const { return segments_.size(); }
  std::size_t on_disk() const;  // segments that the spool holds, too
  std::uint64_t resent() const { return resent_; }  // by all connections

 private:
  const std::size_t max_unacknowledged_;
  std::deque<EncodedSegment> segments_;
  std::size_t in_flight_ = 0;  // the first ones
  std::size_t sent_ = 0;       // the first ones: sent on any connection
  std::uint64_t resent_ = 0;
  bool open_ = false;
};

}  // namespace selfcal::client
