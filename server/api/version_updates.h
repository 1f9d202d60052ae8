// The updates of those who watch the active calibration of a rig: an activation
// is encoded once for all of them. Any thread may call.
#pragma once

#include <absl/status/statusor.h>

#include <deque>
#include <memory>
#include <mutex>

#include "server/api/watch_update.h"
#include "server/store/store.h"

namespace selfcal::server {

class VersionUpdates {
 public:
  // `store` outlives it.
  explicit VersionUpdates(Store* store) : store_(store) {}

  // Returns the update with `version`, which its watchers share: the same
  // object yields the same update while it is one of the kKept newest.
  absl::StatusOr<std::shared_ptr<const WatchUpdate>> Get(
      const std::shared_ptr<const StoredCalibration>& version);

  static constexpr std::size_t kKept = 16;

 private:
  struct Encoded {
    // Held, so that no other version gets its address.
    std::shared_ptr<const StoredCalibration> version;
    std::shared_ptr<const WatchUpdate> update;
  };

  Store* const store_;
  std::mutex mutex_;
  std::deque<Encoded> encoded_;  // guarded by mutex_; the newest first
};

}  // namespace selfcal::server
