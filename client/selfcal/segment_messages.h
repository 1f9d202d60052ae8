// The messages of the stream of segments.
//
// A few segments no message can carry. Sending one would break the stream again
// and again, so they are refused on this side.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "client/selfcal/client.h"
#include "core/model/segment.h"
#include "selfcal/v1/segment.pb.h"

namespace selfcal::client {

// What the daemon takes in one message.
inline constexpr std::size_t kMaxRequestBytes = 64u << 20;
// The longest name of a session that its acknowledgements repeat in full.
inline constexpr std::size_t kMaxSessionBytes = 256;

// Fills *request, or says why the segment cannot be sent.
std::vector<Violation> MakeRequest(const std::string& rig,
                                   const MotionSegment& segment,
                                   v1::StreamSegmentsRequest* request);

// A verdict that this client does not know counts as a rejection.
Acknowledgement ToAcknowledgement(const v1::StreamSegmentsResponse& response);

}  // namespace selfcal::client
