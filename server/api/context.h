// What the handlers work on. All of it outlives the API.
#pragma once

#include <atomic>
#include <functional>
#include <string>

#include "server/domain/domain.h"
#include "server/pipeline/pipeline.h"

namespace selfcal::server {

class EventFeed;       // event_feed.h
class RigWatches;      // rig_watches.h
class Traffic;         // traffic.h
class VersionUpdates;  // version_updates.h

struct ApiContext {
  Domain* domain = nullptr;
  Store* store = nullptr;  // of `domain`
  Pipeline* pipeline = nullptr;
  EventFeed* feed = nullptr;
  RigWatches* watches = nullptr;
  VersionUpdates* versions = nullptr;
  Traffic* traffic = nullptr;  // of segments
  // True once the daemon is stopping: watches and streams end with UNAVAILABLE.
  const std::atomic<bool>* stopping = nullptr;
  // Called when a restored database is ready for the next start; may be null.
  std::function<void()> restored;
  std::string program_version;
};

}  // namespace selfcal::server
