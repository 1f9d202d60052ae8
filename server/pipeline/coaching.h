// The most informative next motion for a rig (core/coach), from the records in
// the store.
//
// Known are the covariance of the active version (after a device change: for
// the components that it does not concern, with the factory's prior for the
// rest), and the information of the segments in the tables that the version was
// not computed on, which the next run will use.
//
// What is missing is planned for with the limits of validation: a component
// that the data determines little better than the prior is not learned, and few
// segments confirm nothing.
//
// The predicted information of the motions is computed at the first request for
// a version of a rig and kept, for the most recently requested rigs. Any thread
// may call; one prediction is computed at a time, on the calling thread, while
// requests that need no computation are answered.
#pragma once

#include <absl/status/statusor.h>

#include <cstddef>
#include <cstdint>
#include <list>
#include <memory>
#include <mutex>
#include <string>

#include "core/coach/advise.h"
#include "core/coach/plan.h"
#include "server/store/store.h"

namespace selfcal::server {

struct RigCoaching {
  Coaching coaching;
  Plan plan;
  std::int64_t calibration_version = 0;  // the active one
  int segments_since = 0;                // in the tables, which it did not use
  double segment_s = 0;                  // segment length of the gains
};

class RigCoach {
 public:
  // Limit on the size of all predictions that are kept.
  static constexpr std::size_t kMaxBytes = 64 << 20;

  // The store must outlive it.
  explicit RigCoach(Store* store, std::size_t max_bytes = kMaxBytes)
      : store_(store), max_bytes_(max_bytes) {}

  // NOT_FOUND for an unknown rig; FAILED_PRECONDITION if the covariance of the
  // active version is not positive definite; errors of the store.
  absl::StatusOr<RigCoaching> Advise(const std::string& rig);

  // Number of predictions computed so far.
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
  std::list<Entry> entries_;  // most recently used first
  std::size_t bytes_ = 0;
  int computed_ = 0;
};

}  // namespace selfcal::server
