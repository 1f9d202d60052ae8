// Conversion between segments and the messages of StreamSegments.
//
// Some segments do not fit into a message. Sending one would break the stream
// again and again, so the client refuses them.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "client/selfcal/client.h"
#include "core/model/segment.h"
#include "selfcal/v1/segment.pb.h"

namespace selfcal::client {

// Size of the largest message that the daemon accepts.
inline constexpr std::size_t kMaxRequestBytes = 64u << 20;
// Length of the longest session name that acknowledgements repeat in full.
inline constexpr std::size_t kMaxSessionBytes = 256;

// Fills *request, or returns the reasons why the segment cannot be sent.
std::vector<Violation> MakeRequest(const std::string& rig,
                                   const MotionSegment& segment,
                                   v1::StreamSegmentsRequest* request);

// Converts a response. A verdict that this client does not know is treated as a
// rejection.
Acknowledgement ToAcknowledgement(const v1::StreamSegmentsResponse& response);

}  // namespace selfcal::client
