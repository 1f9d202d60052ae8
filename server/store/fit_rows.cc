#include "server/store/fit_rows.h"

#include <vector>

#include "core/selection/fit.h"
#include "server/store/absences.h"
#include "server/store/status_macros.h"
#include "server/store/table_rows.h"

namespace selfcal::server {

// As in kFits.
static_assert(static_cast<int>(AbsenceCause::kDoesNotFit) == 8 &&
              static_cast<int>(AbsenceCause::kManyOutliers) == 9);

namespace {

absl::StatusOr<std::vector<double>> ReadFits(Statement* read) {
  std::vector<double> fits;
  while (read->Next()) fits.push_back(read->Double(0));
  SELFCAL_RETURN_IF_ERROR(read->status());
  return fits;
}

// Beside the absences that were written of it.
absl::Status WriteFit(Connection* db,
                      std::int64_t segment,
                      AbsenceCause cause,
                      double fit,
                      double largest_fit) {
  return Statement(db,
                   "UPDATE table_absences SET fit = ?3, fit_limit = ?4 "
                   "WHERE segment = ?1 AND cause = ?2",
                   segment,
                   static_cast<int>(cause),
                   fit,
                   largest_fit)
      .Run();
}

absl::Status Exclude(Connection* db,
                     std::int64_t rig,
                     std::int64_t segment,
                     AbsenceCause cause) {
  return Statement(db,
                   "INSERT OR REPLACE INTO table_absences (segment, "
                   "  group_name, cause, time_ns) "
                   "SELECT ?2, group_name, ?3, ?4 FROM tables WHERE rig = ?1",
                   rig,
                   segment,
                   static_cast<int>(cause),
                   NowNs())
      .Run();
}

}  // namespace

absl::StatusOr<std::optional<double>> ReadLargestFit(Connection* db,
                                                     std::int64_t rig) {
  const FitPolicy policy;
  Statement read_newest(db,
                        "SELECT fit FROM segments WHERE rig = ?1 AND state = 2 "
                        "ORDER BY sequence DESC LIMIT ?2",
                        rig,
                        policy.newest);
  SELFCAL_ASSIGN_OR_RETURN(const std::vector<double> newest,
                           ReadFits(&read_newest));
  Statement read_kept(db,
                      "SELECT fit FROM segments WHERE segment IN "
                      "  (SELECT segment FROM table_entries WHERE rig = ?1)",
                      rig);
  SELFCAL_ASSIGN_OR_RETURN(const std::vector<double> kept,
                           ReadFits(&read_kept));
  return LargestFit(newest, kept, policy);
}

absl::Status RemoveMisfits(Connection* db,
                           std::int64_t rig,
                           std::optional<double> largest_fit) {
  if (!largest_fit) return absl::OkStatus();
  Statement read(db,
                 "SELECT segment, fit FROM segments WHERE fit > ?2 "
                 "AND segment IN "
                 "  (SELECT segment FROM table_entries WHERE rig = ?1)",
                 rig,
                 *largest_fit);
  struct Misfit {
    std::int64_t segment;
    double fit;
  };
  std::vector<Misfit> misfits;
  while (read.Next()) misfits.push_back({read.Int(0), read.Double(1)});
  SELFCAL_RETURN_IF_ERROR(read.status());
  for (const Misfit& misfit : misfits) {
    SELFCAL_RETURN_IF_ERROR(
        RemoveFromTables(db, misfit.segment, AbsenceCause::kDoesNotFit));
    SELFCAL_RETURN_IF_ERROR(WriteFit(db,
                                     misfit.segment,
                                     AbsenceCause::kDoesNotFit,
                                     misfit.fit,
                                     *largest_fit));
  }
  return absl::OkStatus();
}

absl::StatusOr<bool> AdmitByFit(Connection* db,
                                std::int64_t rig,
                                std::int64_t segment,
                                const ResidualStatistics& residuals,
                                std::optional<double> largest_fit) {
  if (largest_fit && residuals.fit > *largest_fit) {
    SELFCAL_RETURN_IF_ERROR(
        Exclude(db, rig, segment, AbsenceCause::kDoesNotFit));
    SELFCAL_RETURN_IF_ERROR(WriteFit(
        db, segment, AbsenceCause::kDoesNotFit, residuals.fit, *largest_fit));
    return false;
  }
  if (residuals.many_outliers) {
    SELFCAL_RETURN_IF_ERROR(
        Exclude(db, rig, segment, AbsenceCause::kManyOutliers));
    return false;
  }
  return true;
}

}  // namespace selfcal::server
