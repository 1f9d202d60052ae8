#include "server/api/rig_watches.h"

#include <utility>
#include <vector>

namespace selfcal::server {

std::shared_ptr<void> RigWatches::Add(
    const std::string& rig, const std::shared_ptr<WatchQueue>& queue) {
  const std::lock_guard lock(registered_->mutex);
  const auto place = registered_->queues.emplace(rig, queue);
  return {nullptr, [registered = registered_, place](void*) {
            const std::lock_guard lock(registered->mutex);
            registered->queues.erase(place);
          }};
}

void RigWatches::End(const std::string& rig, const absl::Status& why) {
  std::vector<std::shared_ptr<WatchQueue>> queues;
  {
    const std::lock_guard lock(registered_->mutex);
    const auto [begin, end] = registered_->queues.equal_range(rig);
    for (auto it = begin; it != end; ++it) {
      if (auto queue = it->second.lock()) queues.push_back(std::move(queue));
    }
  }
  for (const auto& queue : queues) queue->Close(why);
}

}  // namespace selfcal::server
