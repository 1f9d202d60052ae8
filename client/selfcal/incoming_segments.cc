#include "client/selfcal/incoming_segments.h"

#include <cassert>
#include <exception>
#include <utility>

namespace selfcal::client {

bool IncomingSegments::Push(UnencodedSegment&& segment,
                            std::size_t elsewhere) noexcept {
  if (!HasRoom(elsewhere)) return false;
  try {
    waiting_.push_back(std::move(segment));
  } catch (const std::exception&) {  // no memory
    return false;
  }
  return true;
}

std::optional<UnencodedSegment> IncomingSegments::Take() {
  assert(!taken_);
  if (waiting_.empty()) return std::nullopt;
  std::optional<UnencodedSegment> oldest(std::move(waiting_.front()));
  waiting_.pop_front();
  taken_ = true;
  return oldest;
}

}  // namespace selfcal::client
