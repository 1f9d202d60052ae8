#include "server/metrics/recent_rigs.h"

#include <algorithm>
#include <array>

namespace selfcal::server {

void RecentRigs::Heard(const std::string& rig) {
  const std::lock_guard lock(mutex_);
  const auto found = std::find(rigs_.begin(), rigs_.end(), rig);
  if (found != rigs_.end()) {
    rigs_.splice(rigs_.begin(), rigs_, found);
    return;
  }
  rigs_.push_front(rig);
  if (static_cast<int>(rigs_.size()) > limit_) rigs_.pop_back();
}

std::vector<std::string> RecentRigs::List() const {
  const std::lock_guard lock(mutex_);
  std::vector<std::string> rigs(rigs_.begin(), rigs_.end());
  std::sort(rigs.begin(), rigs.end());
  return rigs;
}

std::string GroupLabel(std::string_view group) {
  constexpr std::array<std::string_view, 5> kUsual = {
      "imu", "camera", "extrinsics", "time", "joint"};
  const bool usual =
      std::find(kUsual.begin(), kUsual.end(), group) != kUsual.end();
  return std::string(usual ? group : "other");
}

}  // namespace selfcal::server
