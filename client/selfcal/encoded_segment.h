// A segment as the queue holds it: first as the SLAM system hands it over, then
// encoded as the message that is sent.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <variant>

#include "client/selfcal/client.h"
#include "client/selfcal/closed_segment.h"
#include "core/model/segment.h"
#include "selfcal/v1/segment.pb.h"

namespace selfcal::client {

using UnencodedSegment = std::variant<MotionSegment, ClosedSegment>;

struct EncodedSegment {
  std::uint64_t number = 0;  // defines the order and the name in the spool
  SegmentKey key;
  std::shared_ptr<const v1::StreamSegmentsRequest> request;
  bool on_disk = false;  // has a file in the spool
};

// Assembles and encodes a segment; the number is left 0. Returns a rejection if
// the segment does not fit into a message. Adds to *statistics unless it is
// null. Throws std::bad_alloc.
std::variant<EncodedSegment, Acknowledgement> Encode(
    const std::string& rig,
    UnencodedSegment segment,
    AssemblyStatistics* statistics = nullptr);

}  // namespace selfcal::client
