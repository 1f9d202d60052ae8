// Commits the score of a stored segment: the segment is offered to the tables,
// the newest segments are tested for a device change, and a run may start.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/change/detect_change.h"
#include "core/information/segment_ends.h"
#include "core/information/segment_information.h"
#include "server/domain/offers.h"
#include "server/store/store.h"
#include "server/store/unit_of_work.h"

namespace selfcal::server {

// The version and the prior with which a segment is scored.
struct ScoreBasis {
  std::int64_t active = 0;       // version
  Eigen::VectorXd prior_sigmas;  // of the rig
  // Run at whose candidate it is scored instead, which was validated against
  // the active version; 0: none.
  std::int64_t run = 0;

  bool operator==(const ScoreBasis& other) const {
    return active == other.active && prior_sigmas == other.prior_sigmas &&
           run == other.run;
  }
};

// The basis with which a new segment of the rig is to be scored at present,
// which is never a candidate.
absl::StatusOr<ScoreBasis> PresentBasis(UnitOfWork* tx, const Rig& rig);

// Result of the commit of a score.
struct ScoreCommit {
  std::vector<std::string> tables;  // groups it entered
  // Basis at the commit. If this is not what the score was computed with, it
  // has to be computed again: another version was activated meanwhile, or the
  // prior changed, and the segment was not among those to be scored again.
  ScoreBasis basis;
  std::optional<StoredRun> started_run;  // the trigger fired
  std::optional<StoredChange> change;    // was detected
};

// Domain::CommitScore.
absl::StatusOr<ScoreCommit> CommitScore(
    UnitOfWork* tx,
    const SegmentKey& key,
    const SegmentInformation& information,
    const std::optional<SegmentEnds>& ends,
    const std::optional<JointDecision>& decided,
    const ChangeOptions& options);

// Domain::ReplaceScore.
absl::Status ReplaceScore(UnitOfWork* tx,
                          const ScoreBasis& basis,
                          const SegmentKey& key,
                          const SegmentInformation& information,
                          const SegmentEnds& ends);

}  // namespace selfcal::server
