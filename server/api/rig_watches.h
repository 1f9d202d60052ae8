// The open watches of each rig, so that they end when it is deleted. Any thread
// may call.
#pragma once

#include <absl/status/status.h>

#include <map>
#include <memory>
#include <mutex>
#include <string>

#include "server/api/watch_queue.h"

namespace selfcal::server {

class RigWatches {
 public:
  // Registers a watch of the rig for as long as the result lives, which may
  // outlive this object.
  std::shared_ptr<void> Add(const std::string& rig,
                            const std::shared_ptr<WatchQueue>& queue);

  // Ends every watch of the rig, after the updates that wait for it.
  void End(const std::string& rig, const absl::Status& why);

 private:
  struct Registered {
    std::mutex mutex;
    std::multimap<std::string, std::weak_ptr<WatchQueue>> queues;
  };

  const std::shared_ptr<Registered> registered_ =
      std::make_shared<Registered>();
};

}  // namespace selfcal::server
