#include "server/pipeline/rescoring.h"

#include <absl/status/status.h>
#include <spdlog/spdlog.h>

#include <exception>
#include <vector>

#include "server/pipeline/stored_information.h"
#include "server/status/status_macros.h"

namespace selfcal::server {
namespace {

absl::Status TryRescore(Domain* domain,
                        const Estimators& estimators,
                        const RigClaim& claim,
                        std::int64_t active,
                        const Calibration& theta) {
  const std::string& rig_id = claim.rig;
  Store* const store = domain->store();
  SELFCAL_ASSIGN_OR_RETURN(const StoredRig rig, store->GetRig(rig_id));
  SELFCAL_ASSIGN_OR_RETURN(const std::vector<StoredSegment> kept,
                           ListKept(store, rig_id));
  for (const StoredSegment& stored : kept) {
    const auto segment = store->GetSegmentData(rig_id, stored.key);
    if (absl::IsDataLoss(segment.status()) ||
        absl::IsFailedPrecondition(segment.status())) {
      continue;  // damaged, as the next run finds, or deleted meanwhile
    }
    SELFCAL_RETURN_IF_ERROR(segment.status());
    SELFCAL_RETURN_IF_ERROR(
        domain->ReplaceScore(claim,
                             active,
                             stored.key,
                             estimators.score(rig.rig, theta, *segment),
                             estimators.ends(rig.rig, theta, *segment)));
  }
  return absl::OkStatus();
}

}  // namespace

void RescoreKept(Domain* domain,
                 const Estimators& estimators,
                 const RigClaim& claim,
                 std::int64_t active,
                 const Calibration& theta) {
  if (!estimators.ends) return;
  absl::Status status;
  try {
    status = TryRescore(domain, estimators, claim, active, theta);
  } catch (const std::exception& error) {
    status = absl::InternalError(error.what());
  }
  if (!status.ok()) {
    spdlog::warn("not all kept segments of rig {} are rescored: {}",
                 claim.rig,
                 status.ToString());
  }
}

}  // namespace selfcal::server
