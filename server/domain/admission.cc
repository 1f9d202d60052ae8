#include "server/domain/admission.h"

#include <vector>

#include "core/selection/fit.h"
#include "server/domain/exclusion.h"
#include "server/status/status_macros.h"
#include "server/store/segment_rows.h"
#include "server/store/table_rows.h"

namespace selfcal::server {

absl::StatusOr<std::optional<double>> LargestFitOfRig(UnitOfWork* tx) {
  const FitPolicy policy;
  SELFCAL_ASSIGN_OR_RETURN(const std::vector<double> newest,
                           NewestFits(tx, policy.newest));
  SELFCAL_ASSIGN_OR_RETURN(const std::vector<SegmentRow> kept,
                           SegmentsInTables(tx));
  std::vector<double> fits;
  for (const SegmentRow& segment : kept) fits.push_back(segment.fit);
  return LargestFit(newest, fits, policy);
}

absl::Status RemoveMisfits(UnitOfWork* tx, std::optional<double> largest_fit) {
  if (!largest_fit) return absl::OkStatus();
  SELFCAL_ASSIGN_OR_RETURN(const std::vector<SegmentRow> kept,
                           SegmentsInTables(tx));
  for (const SegmentRow& segment : kept) {
    if (segment.fit <= *largest_fit) continue;
    SELFCAL_RETURN_IF_ERROR(LeaveTables(tx,
                                        segment.sequence,
                                        {.cause = ExclusionCause::kDoesNotFit,
                                         .fit = segment.fit,
                                         .fit_limit = largest_fit}));
  }
  return absl::OkStatus();
}

absl::StatusOr<bool> Admit(UnitOfWork* tx,
                           std::int64_t segment,
                           const ResidualStatistics& residuals,
                           std::optional<double> largest_fit) {
  if (largest_fit && residuals.fit > *largest_fit) {
    SELFCAL_RETURN_IF_ERROR(RefuseTables(tx,
                                         segment,
                                         {.cause = ExclusionCause::kDoesNotFit,
                                          .fit = residuals.fit,
                                          .fit_limit = largest_fit}));
    return false;
  }
  if (residuals.many_outliers) {
    SELFCAL_RETURN_IF_ERROR(
        RefuseTables(tx, segment, {.cause = ExclusionCause::kManyOutliers}));
    return false;
  }
  return true;
}

}  // namespace selfcal::server
