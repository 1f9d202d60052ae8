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
  const ScoreBasis basis{active, PriorSigmas(rig.rig)};
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
                             basis,
                             stored.key,
                             estimators.score(rig.rig, theta, *segment),
                             estimators.ends(rig.rig, theta, *segment)));
  }
  return absl::OkStatus();
}

absl::Status TryRescoreAtActive(Domain* domain,
                                const Estimators& estimators,
                                const RigClaim& claim) {
  SELFCAL_RETURN_IF_ERROR(domain->NoteOutdatedScores(claim));
  Store* const store = domain->store();
  SELFCAL_ASSIGN_OR_RETURN(const StoredRig rig, store->GetRig(claim.rig));
  SELFCAL_ASSIGN_OR_RETURN(const StoredCalibration active,
                           store->GetActiveCalibration(claim.rig));
  if (!RescoreKept(domain, estimators, claim, active.version, active.theta)) {
    return absl::OkStatus();  // it stays recorded
  }
  return domain->EndRescoring(claim, {active.version, PriorSigmas(rig.rig)});
}

}  // namespace

bool RescoreKept(Domain* domain,
                 const Estimators& estimators,
                 const RigClaim& claim,
                 std::int64_t active,
                 const Calibration& theta) {
  if (!estimators.ends) return true;
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
  return status.ok();
}

void RescoreAtActive(Domain* domain,
                     const Estimators& estimators,
                     const RigClaim& claim) {
  const absl::Status status = TryRescoreAtActive(domain, estimators, claim);
  if (!status.ok()) {
    spdlog::warn("scores of rig {} are outdated until another attempt: {}",
                 claim.rig,
                 status.ToString());
  }
}

}  // namespace selfcal::server
