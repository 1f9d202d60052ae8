// The open watches of each rig, so that they end when it is deleted. Any thread
// may call.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "server/api/watch_queue.h"
#include "server/store/store.h"

namespace selfcal::server {

class RigWatches {
 public:
  // `store` outlives it, and all that it returns.
  explicit RigWatches(Store* store) : store_(store) {}

  // Registers a watch of the rig for as long as the result lives, which may
  // outlive this object. Errors are those of the store; a rig that does not
  // exist is none.
  absl::StatusOr<std::shared_ptr<void>> Add(
      const std::string& rig, const std::shared_ptr<WatchQueue>& queue);

  // Ends every watch of the rig, which was deleted, with NOT_FOUND, after the
  // updates that wait for it.
  void End(const std::string& rig);
  // A function that does so with the watches of a rig, or of all rigs if the
  // name is empty, as far as the rig is gone or another one has its name. Does
  // nothing if the store fails. It may outlive this object.
  std::function<void(const std::string& rig)> DeletionHandler() const;

 private:
  struct Watch {
    std::optional<std::int64_t> rig_key;  // nullopt: not read yet
    std::weak_ptr<WatchQueue> queue;
  };
  using Watches = std::multimap<std::string, Watch>;
  struct Registered {
    std::mutex mutex;
    Watches watches;  // by rig; guarded by mutex
  };

  // Those of a rig or, if the name is empty, of all.
  static Watches Copy(Registered* registered, const std::string& rig);
  static void EndWatchesOfDeletedRig(Store* store,
                                     Registered* registered,
                                     const std::string& rig);

  Store* const store_;
  const std::shared_ptr<Registered> registered_ =
      std::make_shared<Registered>();
};

}  // namespace selfcal::server
