// Scores of a rig that were computed with another version or prior than the
// present one. The rig records that it has some in the transaction that makes
// them so, until all of those whose data is kept are computed again: another
// start, or another daemon, continues what was interrupted.
//
// A run writes scores at its candidate before this becomes the active version.
// The rig records that before the first of them, and, in the transaction that
// ends the run, that they are outdated: if the candidate has become active, the
// run ends that as a rescoring. Until then only the run writes scores again, so
// that those of two versions are not mixed.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>

#include "server/domain/score_commit.h"
#include "server/store/unit_of_work.h"

namespace selfcal::server {

// Records that scores of the rig are outdated. The caller computes them again;
// if that does not end within a minute, somebody else does (RigCheck::kScores).
// While a run writes scores at its candidate, its record stands for this one.
absl::Status NoteOutdatedScores(UnitOfWork* tx);

// Records that the run writes scores at its candidate: nobody else computes
// outdated scores before it ends, however long it takes. FAILED_PRECONDITION if
// it is not running.
absl::Status NoteCandidateScores(UnitOfWork* tx, std::int64_t run);

// The run that writes scores at its candidate; 0 if none does.
absl::StatusOr<std::int64_t> RunAtCandidate(UnitOfWork* tx);

// Makes the scores of a run that has written some at its candidate outdated
// ones, as NoteOutdatedScores, when it ends or is released.
absl::Status EndCandidateScores(UnitOfWork* tx);

// Domain::EndRescoring.
absl::Status EndRescoring(UnitOfWork* tx, const ScoreBasis& basis);

}  // namespace selfcal::server
