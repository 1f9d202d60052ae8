#include "server/domain/outdated_scores.h"

#include <optional>

#include "server/domain/run_life.h"
#include "server/status/status_macros.h"
#include "server/store/rig_checks.h"
#include "server/store/rigs.h"
#include "server/store/runs.h"

namespace selfcal::server {
namespace {

// The scores of a rig with many segments take a few seconds.
constexpr std::int64_t kRescoringNs = 60'000'000'000;

// The time of the check while a run writes scores at its candidate: none is due
// before it ends.
constexpr std::int64_t kAtEndOfRun = kNoCheck;

absl::StatusOr<bool> AreCandidateScores(UnitOfWork* tx) {
  SELFCAL_ASSIGN_OR_RETURN(const auto next_ns,
                           NextCheck(tx, RigCheck::kScores));
  return next_ns == kAtEndOfRun;
}

absl::Status SetDue(UnitOfWork* tx) {
  return SetCheck(tx, RigCheck::kScores, tx->now().steady_ns + kRescoringNs);
}

}  // namespace

absl::Status NoteOutdatedScores(UnitOfWork* tx) {
  SELFCAL_ASSIGN_OR_RETURN(const bool by_run, AreCandidateScores(tx));
  return by_run ? absl::OkStatus() : SetDue(tx);
}

absl::Status NoteCandidateScores(UnitOfWork* tx, std::int64_t run) {
  SELFCAL_RETURN_IF_ERROR(ReadRunningRun(tx, run).status());
  return SetCheck(tx, RigCheck::kScores, kAtEndOfRun);
}

absl::StatusOr<std::int64_t> RunAtCandidate(UnitOfWork* tx) {
  SELFCAL_ASSIGN_OR_RETURN(const bool by_run, AreCandidateScores(tx));
  return by_run ? UnfinishedRun(tx) : 0;
}

absl::Status EndCandidateScores(UnitOfWork* tx) {
  SELFCAL_ASSIGN_OR_RETURN(const bool by_run, AreCandidateScores(tx));
  return by_run ? SetDue(tx) : absl::OkStatus();
}

absl::Status EndRescoring(UnitOfWork* tx, const ScoreBasis& basis) {
  SELFCAL_ASSIGN_OR_RETURN(const StoredRig rig, ReadRig(tx));
  SELFCAL_ASSIGN_OR_RETURN(ScoreBasis present, PresentBasis(tx, rig.rig));
  SELFCAL_ASSIGN_OR_RETURN(present.run, RunAtCandidate(tx));
  if (present != basis) return absl::OkStatus();
  return SetCheck(tx, RigCheck::kScores, std::nullopt);
}

}  // namespace selfcal::server
