// The limits of the queue of a stream, in segments; each is at least 1.
#pragma once

#include <algorithm>
#include <cstddef>

#include "client/selfcal/client.h"

namespace selfcal::client {

// Segments in memory.
inline std::size_t MaxInMemory(const ClientOptions& options) {
  return static_cast<std::size_t>(std::max(options.max_queue, 1));
}

// Segments in the window. With a spool, half of the queue is for segments that
// wait for the disk.
inline std::size_t MaxInWindow(const ClientOptions& options, bool with_spool) {
  const std::size_t all = MaxInMemory(options);
  return with_spool ? std::max<std::size_t>(all / 2, 1) : all;
}

// Segments in flight.
inline std::size_t MaxInFlight(const ClientOptions& options) {
  return static_cast<std::size_t>(std::max(options.max_unacknowledged, 1));
}

}  // namespace selfcal::client
