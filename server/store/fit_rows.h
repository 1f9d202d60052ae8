// How well the segments of a rig fit, and those that do not, in the database.
// All of it runs inside a transaction of the caller.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <optional>
#include <string_view>

#include "core/information/segment_information.h"
#include "server/store/statement.h"

namespace selfcal::server {

// LargestFit (core/selection) of the rig as it stands.
absl::StatusOr<std::optional<double>> ReadLargestFit(Connection* db,
                                                     std::int64_t rig);

// Takes segments of a larger fit out of all tables, and writes down why.
absl::Status RemoveMisfits(Connection* db,
                           std::int64_t rig,
                           std::optional<double> largest_fit);

// Condition on a row `s` of segments: the segment was not kept out of the
// tables, or taken out of them, for how badly it fits. One that was is evidence
// for nothing: it is not remembered, tests no candidate, and shows no change of
// the device.
inline constexpr std::string_view kFits =
    "NOT EXISTS (SELECT 1 FROM table_absences a "
    "  WHERE a.segment = s.segment AND a.cause IN (8, 9))";

// False for a segment that the tables shall not be offered, of which is then
// written down why no table holds it: it does not fit, or had many outliers.
absl::StatusOr<bool> AdmitByFit(Connection* db,
                                std::int64_t rig,
                                std::int64_t segment,
                                const ResidualStatistics& residuals,
                                std::optional<double> largest_fit);

}  // namespace selfcal::server
