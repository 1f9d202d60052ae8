// The exchange of a StreamSegments call. Internal to server/api.
#pragma once

#include <memory>

#include "server/api/context.h"
#include "server/api/method.h"

namespace selfcal::server {

// Answers each segment with its verdict; an error ends the stream: the rig of
// the first message does not exist, or the store fails. A request waits while
// the queue of the daemon is full, but not for the disk. The end of the
// exchange is the end of a session if it has stored a segment, unless the
// daemon is stopping.
std::unique_ptr<Exchange> MakeSegmentStream(const ApiContext& context,
                                            const Call& call);

}  // namespace selfcal::server
