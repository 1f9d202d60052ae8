// Waits until a stream has nothing left to send.
#pragma once

#include <absl/status/status.h>

#include <chrono>

#include "client/selfcal/client.h"
#include "test/support/eventually.h"

namespace selfcal::client {

// Returns what Drain returns, DEADLINE_EXCEEDED only after the limit. In many
// short waits, as Eventually counts them.
inline absl::Status DrainFully(SegmentStream* stream,
                               std::chrono::nanoseconds limit = kLongWait) {
  absl::Status status;
  Eventually(
      [&] {
        status = stream->Drain(std::chrono::milliseconds(100));
        return !absl::IsDeadlineExceeded(status);
      },
      limit);
  return status;
}

}  // namespace selfcal::client
