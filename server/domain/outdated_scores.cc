#include "server/domain/outdated_scores.h"

#include "server/status/status_macros.h"
#include "server/store/rig_checks.h"
#include "server/store/rigs.h"

namespace selfcal::server {
namespace {

// The scores of a rig with many segments take a few seconds.
constexpr std::int64_t kRescoringNs = 60'000'000'000;

}  // namespace

absl::Status NoteOutdatedScores(UnitOfWork* tx) {
  return SetCheck(tx, RigCheck::kScores, tx->now().steady_ns + kRescoringNs);
}

absl::Status EndRescoring(UnitOfWork* tx, const ScoreBasis& basis) {
  SELFCAL_ASSIGN_OR_RETURN(const StoredRig rig, ReadRig(tx));
  SELFCAL_ASSIGN_OR_RETURN(const ScoreBasis present, PresentBasis(tx, rig.rig));
  if (present != basis) return absl::OkStatus();
  return SetCheck(tx, RigCheck::kScores, std::nullopt);
}

}  // namespace selfcal::server
