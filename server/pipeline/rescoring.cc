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
                        const Rig& rig,
                        const ScoreBasis& basis,
                        const Calibration& theta) {
  Store* const store = domain->store();
  SELFCAL_ASSIGN_OR_RETURN(const std::vector<StoredSegment> kept,
                           ListKept(store, claim.rig));
  for (const StoredSegment& stored : kept) {
    const auto segment = store->GetSegmentData(claim.rig, stored.key);
    if (absl::IsDataLoss(segment.status()) ||
        absl::IsFailedPrecondition(segment.status())) {
      continue;  // damaged, as the next run finds, or deleted meanwhile
    }
    SELFCAL_RETURN_IF_ERROR(segment.status());
    SELFCAL_RETURN_IF_ERROR(
        domain->ReplaceScore(claim,
                             basis,
                             stored.key,
                             estimators.score(rig, theta, *segment),
                             estimators.ends(rig, theta, *segment)));
  }
  return absl::OkStatus();
}

// Scores the kept segments at `theta`, the calibration of the basis. True if
// all of them have such a score.
bool RescoreKept(Domain* domain,
                 const Estimators& estimators,
                 const RigClaim& claim,
                 const Rig& rig,
                 const ScoreBasis& basis,
                 const Calibration& theta) {
  if (!estimators.ends) return true;
  absl::Status status;
  try {
    status = TryRescore(domain, estimators, claim, rig, basis, theta);
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

void LogOutdated(const RigClaim& claim, const absl::Status& status) {
  if (status.ok()) return;
  spdlog::warn("scores of rig {} are outdated until another attempt: {}",
               claim.rig,
               status.ToString());
}

absl::Status TryRescoreAtActive(Domain* domain,
                                const Estimators& estimators,
                                const RigClaim& claim) {
  SELFCAL_RETURN_IF_ERROR(domain->NoteOutdatedScores(claim));
  Store* const store = domain->store();
  SELFCAL_ASSIGN_OR_RETURN(const StoredRig rig, store->GetRig(claim.rig));
  SELFCAL_ASSIGN_OR_RETURN(const StoredCalibration active,
                           store->GetActiveCalibration(claim.rig));
  const ScoreBasis basis{active.version, PriorSigmas(rig.rig)};
  if (!RescoreKept(domain, estimators, claim, rig.rig, basis, active.theta)) {
    return absl::OkStatus();  // it stays recorded
  }
  return domain->EndRescoring(claim, basis);
}

}  // namespace

void RescoreAtActive(Domain* domain,
                     const Estimators& estimators,
                     const RigClaim& claim) {
  LogOutdated(claim, TryRescoreAtActive(domain, estimators, claim));
}

absl::StatusOr<CandidateScores> RescoreAtCandidate(
    Domain* domain,
    const Estimators& estimators,
    const RigClaim& claim,
    std::int64_t run,
    const StoredCalibration& candidate) {
  SELFCAL_RETURN_IF_ERROR(domain->NoteCandidateScores(claim, run));
  SELFCAL_ASSIGN_OR_RETURN(const StoredRig rig,
                           domain->store()->GetRig(claim.rig));
  const ScoreBasis basis{
      candidate.validation->active_version, PriorSigmas(rig.rig), run};
  const bool complete =
      RescoreKept(domain, estimators, claim, rig.rig, basis, candidate.theta);
  return CandidateScores{basis.prior_sigmas, complete};
}

void EndRescoringOfRun(Domain* domain,
                       const Estimators& estimators,
                       const RigClaim& claim,
                       const StoredCalibration& finished,
                       const CandidateScores& scores) {
  if (scores.complete && finished.state == CalibrationState::kActive) {
    LogOutdated(
        claim,
        domain->EndRescoring(claim, {finished.version, scores.prior_sigmas}));
  } else {
    RescoreAtActive(domain, estimators, claim);
  }
}

}  // namespace selfcal::server
