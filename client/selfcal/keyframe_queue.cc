#include "client/selfcal/keyframe_queue.h"

#include <algorithm>
#include <type_traits>
#include <utility>

#include "client/selfcal/saturated_times.h"

namespace selfcal::client {

// Otherwise a vector that grows would copy every observation.
static_assert(std::is_nothrow_move_constructible_v<PendingKeyframe>);

void KeyframeQueue::Add(PendingKeyframe keyframe) {
  keyframes_.push_back(std::move(keyframe));
}

std::optional<std::size_t> KeyframeQueue::ClosedSize() const {
  if (keyframes_.empty()) return std::nullopt;
  for (std::size_t n = 1; n < keyframes_.size(); ++n) {
    const bool same_version =
        keyframes_[n].estimation.version == keyframes_[0].estimation.version;
    if (!same_version || (n >= 2 && IsFull(n))) return n;
  }
  return std::nullopt;
}

bool KeyframeQueue::IsFull(std::size_t n) const {
  if (segment_.duration_ns) {
    return Elapsed(keyframes_[n].t_ns(), keyframes_[0].t_ns()) >=
           *segment_.duration_ns;
  }
  return n >= static_cast<std::size_t>(std::max(segment_.keyframes, 2));
}

std::int64_t KeyframeQueue::EndOf(std::size_t n) const {
  const std::int64_t end_ns = keyframes_[n - 1].end_ns();
  return n < keyframes_.size() ? std::max(keyframes_[n].t_ns(), end_ns)
                               : end_ns;
}

void KeyframeQueue::Release(std::size_t n,
                            std::vector<ObservedKeyframe>* segment) {
  for (std::size_t i = 0; i < n; ++i) {
    segment->push_back(std::move(keyframes_[i].observed));
  }
  DropFirst(n);
}

std::size_t KeyframeQueue::DropFirst(std::size_t n) {
  const auto end = keyframes_.begin() + static_cast<std::ptrdiff_t>(n);
  keyframes_.erase(keyframes_.begin(), end);
  return n;
}

std::size_t KeyframeQueue::DropBefore(std::int64_t t_ns) {
  const auto first = std::find_if(
      keyframes_.begin(), keyframes_.end(), [&](const PendingKeyframe& k) {
        return k.begin_ns() >= t_ns;
      });
  return DropFirst(static_cast<std::size_t>(first - keyframes_.begin()));
}

std::size_t KeyframeQueue::Free() {
  const std::size_t dropped = keyframes_.size();
  std::vector<PendingKeyframe>().swap(keyframes_);
  return dropped;
}

}  // namespace selfcal::client
