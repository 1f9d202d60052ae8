#include "server/domain/score_commit.h"

#include <fmt/format.h>

#include <cmath>

#include "server/domain/admission.h"
#include "server/domain/device_change.h"
#include "server/domain/outdated_scores.h"
#include "server/domain/remembered.h"
#include "server/domain/report_data.h"
#include "server/domain/retention.h"
#include "server/domain/run_creation.h"
#include "server/status/status_macros.h"
#include "server/store/calibrations.h"
#include "server/store/rigs.h"
#include "server/store/segment_rows.h"
#include "server/store/table_rows.h"

namespace selfcal::server {
namespace {

// FAILED_PRECONDITION unless scores may be replaced by those of this basis.
absl::Status CheckBasis(UnitOfWork* tx,
                        const Rig& rig,
                        const ScoreBasis& basis) {
  SELFCAL_ASSIGN_OR_RETURN(const ScoreBasis present, PresentBasis(tx, rig));
  if (present.active != basis.active) {
    return absl::FailedPreconditionError(
        fmt::format("version {} of rig {} is active by now, not {}",
                    present.active,
                    tx->rig(),
                    basis.active));
  }
  if (present.prior_sigmas != basis.prior_sigmas) {
    return absl::FailedPreconditionError(
        fmt::format("rig {} has another prior by now", tx->rig()));
  }
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t run, RunAtCandidate(tx));
  if (run == basis.run) return absl::OkStatus();
  return absl::FailedPreconditionError(
      basis.run == 0
          ? fmt::format("run {} of rig {} scores the segments at its candidate",
                        run,
                        tx->rig())
          : fmt::format("run {} of rig {} no longer scores at its candidate",
                        basis.run,
                        tx->rig()));
}

}  // namespace

absl::StatusOr<ScoreBasis> PresentBasis(UnitOfWork* tx, const Rig& rig) {
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t active, ActiveVersion(tx));
  return ScoreBasis{active, PriorSigmas(rig)};
}

absl::StatusOr<ScoreCommit> CommitScore(
    UnitOfWork* tx,
    const SegmentKey& key,
    const SegmentInformation& information,
    const std::optional<SegmentEnds>& ends,
    const std::optional<JointDecision>& decided,
    const ChangeOptions& options) {
  SELFCAL_ASSIGN_OR_RETURN(const StoredRig rig, ReadRig(tx));
  SELFCAL_ASSIGN_OR_RETURN(const SegmentRow segment, FindSegment(tx, key));
  ScoreCommit commit;
  SELFCAL_ASSIGN_OR_RETURN(commit.basis, PresentBasis(tx, rig.rig));
  if (segment.state == SegmentState::kScored) {
    SELFCAL_ASSIGN_OR_RETURN(commit.tables,
                             TablesOfSegment(tx, segment.sequence));
    return commit;
  }
  if (segment.state == SegmentState::kUnusable) {
    return absl::FailedPreconditionError(
        SegmentText(tx->rig(), key) +
        " was found unusable; send it again under "
        "another session");
  }
  SELFCAL_RETURN_IF_ERROR(WriteScore(tx, segment, information));
  if (ends) {
    SELFCAL_RETURN_IF_ERROR(Remember(tx, segment.sequence, *ends));
  }
  SELFCAL_ASSIGN_OR_RETURN(const std::optional<double> largest_fit,
                           LargestFitOfRig(tx));
  SELFCAL_RETURN_IF_ERROR(RemoveMisfits(tx, largest_fit));
  // At the time of its arrival, however long it waited for its score.
  SELFCAL_ASSIGN_OR_RETURN(
      std::vector<Table> tables,
      RemoveAgedEntries(tx, rig, segment.receive_steady_ns));
  SELFCAL_ASSIGN_OR_RETURN(
      const bool admitted,
      Admit(tx, segment.sequence, information.residuals, largest_fit));
  if (admitted) {
    SELFCAL_ASSIGN_OR_RETURN(
        commit.tables,
        OfferToTables(tx, rig.rig, segment, information, decided, &tables));
  }
  SELFCAL_ASSIGN_OR_RETURN(const NewestExamined examined,
                           ExamineNewest(tx, rig, options));
  commit.change = examined.change;
  if (examined.change || examined.quarantined > 0) {
    SELFCAL_ASSIGN_OR_RETURN(tables, ReadTables(tx));
    SELFCAL_ASSIGN_OR_RETURN(commit.tables,
                             TablesOfSegment(tx, segment.sequence));
  }
  SELFCAL_ASSIGN_OR_RETURN(commit.started_run,
                           CreateRunOfTables(tx, rig, tables));
  SELFCAL_RETURN_IF_ERROR(DropUnneededData(tx));
  SELFCAL_RETURN_IF_ERROR(ReportKeptData(tx, segment.sequence));
  return commit;
}

absl::Status ReplaceScore(UnitOfWork* tx,
                          const ScoreBasis& basis,
                          const SegmentKey& key,
                          const SegmentInformation& information,
                          const SegmentEnds& ends) {
  SELFCAL_ASSIGN_OR_RETURN(const StoredRig rig, ReadRig(tx));
  SELFCAL_RETURN_IF_ERROR(CheckBasis(tx, rig.rig, basis));
  SELFCAL_ASSIGN_OR_RETURN(const SegmentRow segment, FindSegment(tx, key));
  SELFCAL_ASSIGN_OR_RETURN(const bool has_data, HasData(tx, segment.sequence));
  if (segment.state != SegmentState::kScored || !has_data) {
    return absl::OkStatus();
  }
  SELFCAL_RETURN_IF_ERROR(WriteScore(tx, segment, information));
  SELFCAL_RETURN_IF_ERROR(Remember(tx, segment.sequence, ends));
  // Entries of a joint selection have the scores of all its segments together.
  const bool by_score = rig.rig.selection == Selection::kTables;
  for (const GroupScore& score : information.groups) {
    if (!by_score || !std::isfinite(score.entropy)) continue;
    SELFCAL_RETURN_IF_ERROR(WriteEntryScore(tx, segment.sequence, score));
  }
  return absl::OkStatus();
}

}  // namespace selfcal::server
