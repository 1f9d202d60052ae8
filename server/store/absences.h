// Records of exclusions: why a table does not hold a scored segment.
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

// Exclusions of a segment, in the order of the rig's groups. NOT_FOUND if there
// is no such segment.
absl::StatusOr<std::vector<TableAbsence>> ListAbsenceRows(
    Connection* db, const std::string& rig, const SegmentKey& key);

// SQL condition on a row `s` of segments: no table has refused or removed the
// segment because of its residuals. Such a misfit is evidence of nothing: it is
// not remembered, does not validate a candidate, and does not indicate a device
// change.
inline constexpr std::string_view kFits =
    "NOT EXISTS (SELECT 1 FROM table_absences a "
    "  WHERE a.segment = s.segment AND a.cause IN (8, 9))";

// --- Within a unit of work.

// An exclusion to write. It replaces an earlier one of the same segment and
// group; its time is that of the unit of work.
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
