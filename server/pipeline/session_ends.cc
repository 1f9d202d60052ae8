#include "server/pipeline/session_ends.h"

#include <algorithm>

namespace selfcal::server {

void SessionEnds::Add(const std::string& rig, Clock::time_point due) {
  const std::lock_guard lock(mutex_);
  due_[rig] = due;
}

void SessionEnds::Remove(const std::string& rig) {
  const std::lock_guard lock(mutex_);
  due_.erase(rig);
}

bool SessionEnds::Has(const std::string& rig) const {
  const std::lock_guard lock(mutex_);
  return due_.contains(rig);
}

SessionEnds::Clock::time_point SessionEnds::NextDue(
    Clock::time_point now, Clock::time_point latest) const {
  Clock::time_point next = latest;
  const std::lock_guard lock(mutex_);
  for (const auto& [rig, due] : due_) {
    if (due > now) next = std::min(next, due);
  }
  return next;
}

std::vector<std::string> SessionEnds::Due(Clock::time_point now) const {
  std::vector<std::string> ended;
  const std::lock_guard lock(mutex_);
  for (const auto& [rig, due] : due_) {
    if (due <= now) ended.push_back(rig);
  }
  return ended;
}

}  // namespace selfcal::server
