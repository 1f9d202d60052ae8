// Which motion would teach a rig the most now (core/coach), from what the store
// knows of it.
//
// What is known: the covariance of the active version (after a change of the
// device: of what that does not concern, and the factory's prior for the rest),
// and what the segments in the tables say that it did not come from, as the
// next run will use them.
//
// What the motions are predicted to say is computed at the first question about
// a version of a rig and kept, for the rigs that were asked for last. Any
// thread may call; one prediction is computed at a time, on the thread that
// asks, while answers from predictions that are kept go on.
#pragma once

#include <absl/status/statusor.h>

#include <cstddef>
#include <cstdint>
#include <list>
#include <memory>
#include <mutex>
#include <string>

#include "core/coach/advise.h"
#include "server/store/store.h"

namespace selfcal::server {

struct RigCoaching {
  Coaching coaching;
  std::int64_t calibration_version = 0;  // the active one
  int segments_since = 0;                // in the tables, that it did not use
  double segment_s = 0;                  // that the gains are of
};

class RigCoach {
 public:
  // Predictions of more than this together are not kept.
  static constexpr std::size_t kMaxBytes = 64 << 20;

  // The store must outlive it.
  explicit RigCoach(Store* store, std::size_t max_bytes = kMaxBytes)
      : store_(store), max_bytes_(max_bytes) {}

  // NOT_FOUND for an unknown rig; FAILED_PRECONDITION for a version whose
  // covariance says nothing; errors of the store.
  absl::StatusOr<RigCoaching> Advise(const std::string& rig);

  // How often predictions were computed.
  int computed() const;

 private:
  using Kept = std::shared_ptr<const Predictions>;
  struct Entry {
    std::string key;
    Kept predictions;
  };

  Kept PredictionsFor(const StoredRig& rig, const StoredCalibration& active);
  Kept Find(const std::string& key);
  void Keep(Entry entry);

  Store* const store_;
  const std::size_t max_bytes_;
  std::mutex computing_;
  mutable std::mutex mutex_;  // guards what follows; taken after computing_
  std::list<Entry> entries_;  // the last used first
  std::size_t bytes_ = 0;
  int computed_ = 0;
};

}  // namespace selfcal::server
