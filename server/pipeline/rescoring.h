// Scores of kept segments at another calibration than the one that they were
// computed with: the active one, or a candidate that is about to take its
// place. Tables, change detection and predictions then rest on it, and the ends
// of a segment that loses its data were linearised near it.
//
// All scored segments of the rig whose data is kept are scored again. Segments
// whose data is damaged or gone keep their scores; any other error, and another
// active version or prior, end the rescoring and are logged. Nothing is scored
// if the estimators compute no ends.
//
// The rig is recorded as one with outdated scores
// (server/domain/outdated_scores.h) from before the first score until the last,
// so that another call can take the place of one that fails or dies.
#pragma once

#include <absl/status/statusor.h>

#include <Eigen/Core>
#include <cstdint>

#include "server/domain/domain.h"
#include "server/pipeline/pipeline.h"
#include "server/store/rig_claim.h"

namespace selfcal::server {

// Rescores at the active version. Errors are logged. While a run scores at its
// candidate, this scores nothing: the end of that run repairs the scores.
void RescoreAtActive(Domain* domain,
                     const Estimators& estimators,
                     const RigClaim& claim);

// Scores at the candidate of a run.
struct CandidateScores {
  Eigen::VectorXd prior_sigmas;  // that they were computed with
  bool complete = false;         // those of all segments
};

// Rescores at the validated candidate of a running run, before it becomes the
// active version; nobody rescores at the active one until the run ends. Errors
// are those of the store before the first score.
absl::StatusOr<CandidateScores> RescoreAtCandidate(
    Domain* domain,
    const Estimators& estimators,
    const RigClaim& claim,
    std::int64_t run,
    const StoredCalibration& candidate);

// Ends the rescoring when the run has ended with this version. Rescores at the
// active version if that is another one, or if scores are missing.
void EndRescoringOfRun(Domain* domain,
                       const Estimators& estimators,
                       const RigClaim& claim,
                       const StoredCalibration& finished,
                       const CandidateScores& scores);

}  // namespace selfcal::server
