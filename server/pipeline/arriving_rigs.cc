#include "server/pipeline/arriving_rigs.h"

#include <utility>

namespace selfcal::server {

bool ArrivingRigs::Note(const std::string& rig) {
  const std::lock_guard lock(mutex_);
  if (foreign_.contains(rig)) return false;
  arrived_.insert(rig);
  return true;
}

std::set<std::string> ArrivingRigs::Take() {
  const std::lock_guard lock(mutex_);
  return std::exchange(arrived_, {});
}

void ArrivingRigs::NoteForeign(const std::set<std::string>& rigs) {
  const std::lock_guard lock(mutex_);
  foreign_.insert(rigs.begin(), rigs.end());
}

void ArrivingRigs::ForgetForeign() {
  const std::lock_guard lock(mutex_);
  foreign_.clear();
}

}  // namespace selfcal::server
