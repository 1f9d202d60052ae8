// Why tables do not hold a segment, in the database.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "server/store/session.h"
#include "server/store/unit_of_work.h"

namespace selfcal::server {

// In the order of the rig's groups. NOT_FOUND for the segment.
absl::StatusOr<std::vector<TableAbsence>> ListAbsenceRows(
    Connection* db, const std::string& rig, const SegmentKey& key);

// Condition on a row `s` of segments: the tables were not refused to it, nor
// was it taken out of them, for its residuals. One that was is evidence for
// nothing: it is not remembered, tests no candidate, and shows no change of the
// device.
inline constexpr std::string_view kFits =
    "NOT EXISTS (SELECT 1 FROM table_absences a "
    "  WHERE a.segment = s.segment AND a.cause IN (8, 9))";

// --- Within a unit of work.

// Instead of what was known of the segment and the group before; the time is
// that of the unit of work.
struct Absence {
  AbsenceCause cause = AbsenceCause::kSaysTooLittle;
  std::optional<std::int64_t> rival = std::nullopt;  // row of a segment
  std::optional<double> rival_entropy = std::nullopt;
  std::optional<double> fit = std::nullopt;
  std::optional<double> fit_limit = std::nullopt;
};
absl::Status WriteAbsence(UnitOfWork* tx,
                          std::int64_t segment,
                          const std::string& group,
                          const Absence& absence);

}  // namespace selfcal::server
