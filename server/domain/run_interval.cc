#include "server/domain/run_interval.h"

#include <fmt/format.h>

#include "server/status/status_macros.h"

namespace selfcal::server {

absl::StatusOr<std::string> IntervalReason(Store* store,
                                           const StoredRun& run,
                                           std::int64_t now_ns) {
  SELFCAL_ASSIGN_OR_RETURN(const StoredRig rig, store->GetRig(run.rig));
  const std::int64_t interval_ns = rig.policy.recalibration_min_interval_ns;
  if (interval_ns <= 0) return "";
  // The newest is this run.
  SELFCAL_ASSIGN_OR_RETURN(const auto newest,
                           store->ListRuns(run.rig, {2, ""}));
  const bool too_early = newest.items.size() > 1 &&
                         now_ns - newest.items[1].end_steady_ns < interval_ns;
  if (!too_early) return "";
  return fmt::format(
      "the minimum interval of {:g} s since recalibration {} is not over",
      static_cast<double>(interval_ns) * 1e-9,
      newest.items[1].run);
}

}  // namespace selfcal::server
