// Sessions that have ended, each until the run at its end was considered. Any
// thread may call.
#pragma once

#include <chrono>
#include <map>
#include <mutex>
#include <string>
#include <vector>

namespace selfcal::server {

class SessionEnds {
 public:
  using Clock = std::chrono::steady_clock;

  // Notes that the session of a rig has ended, and when its run is due.
  void Add(const std::string& rig, Clock::time_point due);
  // Forgets it: the session goes on, or its run was considered.
  void Remove(const std::string& rig);
  bool Has(const std::string& rig) const;

  // The first due time after `now`; `latest` if there is none before it.
  Clock::time_point NextDue(Clock::time_point now,
                            Clock::time_point latest) const;
  // Rigs whose run is due.
  std::vector<std::string> Due(Clock::time_point now) const;

 private:
  mutable std::mutex mutex_;
  std::map<std::string, Clock::time_point> due_;
};

}  // namespace selfcal::server
