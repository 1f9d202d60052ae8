#include "server/pipeline/run_options.h"

#include <cmath>
#include <optional>
#include <vector>

#include "core/change/aged.h"
#include "server/domain/device_change.h"
#include "server/pipeline/after_change.h"
#include "server/pipeline/stored_information.h"
#include "server/status/status_macros.h"

namespace selfcal::server {

absl::StatusOr<CalibrateOptions> OptionsOfRun(Domain* domain,
                                              CalibrateOptions options,
                                              const StoredRig& rig,
                                              const StoredRun& run) {
  Store* const store = domain->store();
  options.reweight_noise |= rig.rig.reweight_noise;
  SELFCAL_ASSIGN_OR_RETURN(options.remembered,
                           domain->ListRemembered(run.rig, run.run));
  options.walk = WalkDensities(rig.rig, rig.policy.walk_densities) /
                 std::sqrt(kNanosecondsOfDay * 1e-9);
  if (run.change == 0) return options;
  SELFCAL_ASSIGN_OR_RETURN(const StoredChange change,
                           store->GetChange(run.rig, run.change));
  SELFCAL_ASSIGN_OR_RETURN(StoredCalibration before,
                           store->GetCalibration(run.rig, change.base_version));
  // The factory calibration is no estimate.
  if (before.run) {
    before.covariance = CovarianceAt(rig, before, run.create_steady_ns);
    SELFCAL_ASSIGN_OR_RETURN(const std::vector<SegmentInformation> since,
                             ListInformation(store, run.rig, run.segments));
    options.prior = KnownAfter(rig.rig, change, before, since);
  }
  std::optional<StoredChange> earlier;
  if (run.change > 1) {
    SELFCAL_ASSIGN_OR_RETURN(earlier,
                             store->GetChange(run.rig, run.change - 1));
  }
  options.changing = ChangingGroups(change, earlier);
  return options;
}

}  // namespace selfcal::server
