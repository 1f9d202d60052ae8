// The methods of the contract, one handler each, without a transport. gRPC
// (server/grpc) and HTTP (server/console) call the same handlers.
//
// Nothing that a caller sends aborts or throws out of a method. Any thread may
// call; a method may block, except a watch.
#pragma once

#include <atomic>
#include <functional>
#include <string>
#include <vector>

#include "server/api/event_feed.h"
#include "server/api/method.h"
#include "server/api/rig_watches.h"
#include "server/api/traffic.h"
#include "server/api/version_updates.h"
#include "server/domain/domain.h"
#include "server/pipeline/pipeline.h"

namespace selfcal::server {

struct ApiOptions {
  // Called when a restored database is ready for the next start; may be null.
  std::function<void()> restored = nullptr;
  std::string program_version = {};
};

class Api {
 public:
  // All three outlive it. `feed` may be null: then no change is reported to
  // watchers.
  Api(Domain* domain,
      Pipeline* pipeline,
      EventFeed* feed,
      ApiOptions options = {});
  Api(const Api&) = delete;
  Api& operator=(const Api&) = delete;

  // Every method of every service of the contract.
  const std::vector<Method>& methods() const { return methods_; }

  // From now on, methods that wait, and streams, end with UNAVAILABLE.
  void Stop() { stopping_ = true; }
  bool stopping() const { return stopping_; }

 private:
  std::atomic<bool> stopping_ = false;
  RigWatches watches_;
  VersionUpdates versions_;
  Traffic traffic_;
  std::vector<Method> methods_;
};

}  // namespace selfcal::server
