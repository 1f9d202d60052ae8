// Admission by fit: which segments fit well enough to be offered to the tables
// (core/selection/fit.h).
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <optional>

#include "core/information/segment_information.h"
#include "server/store/unit_of_work.h"

namespace selfcal::server {

// LargestFit of the rig in its present state; nullopt if there is no limit yet.
absl::StatusOr<std::optional<double>> LargestFitOfRig(UnitOfWork* tx);

// Removes segments with a larger fit from all tables.
absl::Status RemoveMisfits(UnitOfWork* tx, std::optional<double> largest_fit);

// False for a segment that is not offered to the tables, because it does not
// fit or because too many of its observations are outliers; the reason is
// recorded. A further reason is a value of ExclusionCause
// (server/store/session.h) and of selfcal.v1.TableExclusion.Cause, with its
// words in server/encode/encode_segment.cc.
absl::StatusOr<bool> Admit(UnitOfWork* tx,
                           std::int64_t segment,
                           const ResidualStatistics& residuals,
                           std::optional<double> largest_fit);

}  // namespace selfcal::server
