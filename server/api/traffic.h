// Counts of segments that arrive, by rig, since the daemon started. Any thread
// may call. Only rigs for which a stream was opened take memory.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <string>

namespace selfcal::server {

// Events per minute: each event counts 1 when it happens and decays with a time
// constant of one minute, so that the mean over time is the true rate.
class MinuteRate {
 public:
  using Time = std::chrono::steady_clock::time_point;
  void Count(Time now);
  double At(Time now) const;

 private:
  double value_ = 0;
  Time last_{};
};

struct TrafficCounts {
  int streams = 0;  // open now
  std::int64_t stored = 0;
  std::int64_t rejected = 0;
  double stored_per_minute = 0;
};

class Traffic {
 public:
  using Clock = std::function<MinuteRate::Time()>;
  explicit Traffic(Clock clock = std::chrono::steady_clock::now);

  void Opened(const std::string& rig);  // a stream was opened
  void Closed(const std::string& rig);
  void Stored(const std::string& rig);
  void Rejected(const std::string& rig);

  TrafficCounts Of(const std::string& rig) const;
  TrafficCounts OfAll() const;
  std::int64_t start_time_ns() const { return start_time_ns_; }

 private:
  struct Counters {
    TrafficCounts counts;  // without the rate
    MinuteRate rate;
  };
  template <typename Change>
  void Apply(const std::string& rig, const Change& change);
  TrafficCounts Read(const Counters& counters) const;

  const Clock clock_;
  const std::int64_t start_time_ns_;
  mutable std::mutex mutex_;  // guards the members below
  Counters all_;
  std::map<std::string, Counters> rigs_;
};

}  // namespace selfcal::server
