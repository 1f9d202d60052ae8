// The limits of the queue of a stream, in segments; each is at least 1.
#pragma once

#include <algorithm>
#include <cstddef>

#include "client/selfcal/client.h"

namespace selfcal::client {

// Segments in memory. With a spool, one that comes and one that is read back.
inline std::size_t MaxInMemory(const ClientOptions& options) {
  const int least = options.spool_dir.empty() ? 1 : 2;
  return static_cast<std::size_t>(std::max(options.max_queue, least));
}

// Segments in the window. With a spool, half of the queue is for segments that
// wait for the disk.
// Needs a spool folder if with_spool.
inline std::size_t MaxInWindow(const ClientOptions& options, bool with_spool) {
  const std::size_t all = MaxInMemory(options);
  return with_spool ? all / 2 : all;
}

// Segments in flight.
inline std::size_t MaxInFlight(const ClientOptions& options) {
  return static_cast<std::size_t>(std::max(options.max_unacknowledged, 1));
}

}  // namespace selfcal::client
