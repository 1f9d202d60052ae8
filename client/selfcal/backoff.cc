#include "client/selfcal/backoff.h"

#include <algorithm>

namespace selfcal::client {
namespace {

// Limits waits so that the time at which a wait ends is always representable.
constexpr std::chrono::hours kLongest{24};

}  // namespace

Backoff::Backoff(std::chrono::milliseconds min,
                 std::chrono::milliseconds max,
                 std::uint64_t seed)
    : min_(std::clamp<std::chrono::milliseconds>(
          min, std::chrono::milliseconds(1), kLongest)),
      max_(std::clamp<std::chrono::milliseconds>(max, min_, kLongest)),
      step_(min_),
      random_(seed) {}

std::chrono::milliseconds Backoff::Next() {
  const auto step = step_;
  step_ = step_ > max_ / 2 ? max_ : 2 * step_;
  std::uniform_int_distribution<std::int64_t> jitter((step.count() + 1) / 2,
                                                     step.count());
  return std::chrono::milliseconds(jitter(random_));
}

}  // namespace selfcal::client
