// Acts on what other daemons announce (server/store/announcements.h): passes
// their activations and runs on to the watchers of this one, interrupts a run
// that another one has ended, and looks for a run that another one has created.
// Also passes on what devices report, and whatever of these deletes a rig.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <utility>

#include "server/pipeline/recalibration.h"
#include "server/pipeline/rig_claims.h"
#include "server/pipeline/watchers.h"
#include "server/store/announcements.h"
#include "server/store/store.h"

namespace selfcal::server {

class AnnouncementRelay {
 public:
  // All must outlive it.
  AnnouncementRelay(Store* store,
                    const RigClaims* claims,
                    Recalibrator* recalibrator,
                    Watchers<StoredCalibration>* calibration_watchers,
                    Watchers<RunUpdate>* run_watchers)
      : store_(store),
        claims_(claims),
        recalibrator_(recalibrator),
        calibration_watchers_(calibration_watchers),
        run_watchers_(run_watchers) {}

  void Start();
  // No announcement is acted on afterwards.
  void Stop() { listener_.reset(); }

  // Pipeline::ListenForDeletions.
  void ListenForDeletions(std::function<void(const std::string&)> deleted) {
    const std::lock_guard lock(mutex_);
    deleted_ = std::move(deleted);
  }

  // Passes on what a device has reported of its rig.
  void PassOnRig(const std::string& rig);
  // Passes on the active version of the rig, if it is another one or has
  // another verdict.
  void PassOnActive(const std::string& rig);

 private:
  void Act(const Announcement& announcement);
  // An empty name: of any rig.
  void OnDeletion(const std::string& rig);
  void OnRun(const std::string& rig, std::int64_t number);

  Store* const store_;
  const RigClaims* const claims_;
  Recalibrator* const recalibrator_;
  Watchers<StoredCalibration>* const calibration_watchers_;
  Watchers<RunUpdate>* const run_watchers_;
  std::mutex mutex_;
  std::function<void(const std::string&)> deleted_;  // guarded by mutex_
  std::shared_ptr<void> listener_;  // null unless the database is shared
};

}  // namespace selfcal::server
