#include "server/api/traffic.h"

#include <cmath>
#include <utility>

#include "server/domain/clock.h"

namespace selfcal::server {
namespace {

double Left(MinuteRate::Time from, MinuteRate::Time to) {
  const std::chrono::duration<double, std::ratio<60>> minutes = to - from;
  return std::exp(-minutes.count());
}

}  // namespace

void MinuteRate::Count(Time now) {
  value_ = At(now) + 1;
  last_ = now;
}

double MinuteRate::At(Time now) const {
  return value_ == 0 ? 0 : value_ * Left(last_, now);
}

Traffic::Traffic(Clock clock)
    : clock_(std::move(clock)), start_time_ns_(NowNs()) {}

template <typename Change>
void Traffic::Apply(const std::string& rig, const Change& change) {
  const std::lock_guard lock(mutex_);
  change(&all_);
  change(&rigs_[rig]);
}

void Traffic::Opened(const std::string& rig) {
  Apply(rig, [](Counters* of) { ++of->counts.streams; });
}

void Traffic::Closed(const std::string& rig) {
  Apply(rig, [](Counters* of) { --of->counts.streams; });
}

void Traffic::Stored(const std::string& rig) {
  const MinuteRate::Time now = clock_();
  Apply(rig, [now](Counters* of) {
    ++of->counts.stored;
    of->rate.Count(now);
  });
}

void Traffic::Rejected(const std::string& rig) {
  Apply(rig, [](Counters* of) { ++of->counts.rejected; });
}

TrafficCounts Traffic::Read(const Counters& counters) const {
  TrafficCounts counts = counters.counts;
  counts.stored_per_minute = counters.rate.At(clock_());
  return counts;
}

TrafficCounts Traffic::Of(const std::string& rig) const {
  const std::lock_guard lock(mutex_);
  const auto found = rigs_.find(rig);
  return found == rigs_.end() ? TrafficCounts() : Read(found->second);
}

TrafficCounts Traffic::OfAll() const {
  const std::lock_guard lock(mutex_);
  return Read(all_);
}

}  // namespace selfcal::server
