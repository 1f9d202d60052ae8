#include "client/selfcal/sample_queue.h"

#include <algorithm>
#include <utility>

namespace selfcal::client {
namespace {

// Returns the last sample at or before the time, or else the first sample.
std::vector<ImuSample>::const_iterator SampleBefore(
    const std::vector<ImuSample>& samples, std::int64_t t_ns) {
  const auto first = std::lower_bound(
      samples.begin(), samples.end(), t_ns, [](const auto& sample, auto t) {
        return sample.t_ns < t;
      });
  const bool at = first != samples.end() && first->t_ns == t_ns;
  return first == samples.begin() || at ? first : first - 1;
}

}  // namespace

bool SampleQueue::Add(const ImuSample& sample) {
  if (!samples_.empty() && sample.t_ns <= samples_.back().t_ns) return false;
  samples_.push_back(sample);
  return true;
}

bool SampleQueue::Reaches(std::int64_t t_ns) const {
  return !samples_.empty() && samples_.back().t_ns >= t_ns;
}

void SampleQueue::DropBefore(std::int64_t t_ns) {
  samples_.erase(samples_.cbegin(), SampleBefore(samples_, t_ns));
}

std::vector<ImuSample> SampleQueue::Reserve() const {
  std::vector<ImuSample> reserved;
  reserved.reserve(samples_.size() + samples_.size() / 8);
  return reserved;
}

std::vector<ImuSample> SampleQueue::Release(std::int64_t t_ns,
                                            std::vector<ImuSample> reserved) {
  reserved.assign(SampleBefore(samples_, t_ns), samples_.cend());
  return std::exchange(samples_, std::move(reserved));
}

void SampleQueue::Free() { std::vector<ImuSample>().swap(samples_); }

}  // namespace selfcal::client
