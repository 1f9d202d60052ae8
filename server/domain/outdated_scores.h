// Scores of a rig that were computed with an earlier version or prior. The rig
// records that it has some in the transaction that makes them so, until all of
// those whose data is kept are computed again: another start, or another
// daemon, continues what was interrupted.
#pragma once

#include <absl/status/status.h>

#include "server/domain/score_commit.h"
#include "server/store/unit_of_work.h"

namespace selfcal::server {

// Records that scores of the rig are outdated. The caller computes them again;
// if that does not end within a minute, somebody else does (RigCheck::kScores).
absl::Status NoteOutdatedScores(UnitOfWork* tx);

// Domain::EndRescoring.
absl::Status EndRescoring(UnitOfWork* tx, const ScoreBasis& basis);

}  // namespace selfcal::server
