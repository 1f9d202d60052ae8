#include "server/store/calibration_states.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>

#include "server/store/calibrations.h"
#include "server/store/clock.h"
#include "server/store/status_macros.h"

namespace selfcal::server {
namespace {

struct Transition {
  CalibrationState from;
  CalibrationState to;
};

// Those of migrations/0004_lifecycle.sql.
constexpr Transition kTransitions[] = {
    {CalibrationState::kCandidate, CalibrationState::kActive},
    {CalibrationState::kCandidate, CalibrationState::kRejected},
    {CalibrationState::kActive, CalibrationState::kSuperseded},
    {CalibrationState::kActive, CalibrationState::kRolledBack},
    {CalibrationState::kSuperseded, CalibrationState::kActive},
    {CalibrationState::kRolledBack, CalibrationState::kActive},
};

absl::Status Refusal(std::int64_t version,
                     CalibrationState from,
                     CalibrationState to) {
  return absl::FailedPreconditionError(
      fmt::format("calibration {} is {}, and cannot become {}",
                  version,
                  StateName(from),
                  StateName(to)));
}

}  // namespace

bool MayBecome(CalibrationState from, CalibrationState to) {
  return std::any_of(
      std::begin(kTransitions), std::end(kTransitions), [&](const auto& t) {
        return t.from == from && t.to == to;
      });
}

const char* StateName(CalibrationState state) {
  switch (state) {
    case CalibrationState::kActive:
      return "active";
    case CalibrationState::kSuperseded:
      return "superseded";
    case CalibrationState::kRejected:
      return "rejected";
    case CalibrationState::kCandidate:
      return "a candidate";
    case CalibrationState::kRolledBack:
      return "rolled back";
  }
  return "unknown";
}

absl::Status ChangeState(Connection* db,
                         std::int64_t rig,
                         std::int64_t version,
                         CalibrationState from,
                         CalibrationState to) {
  if (!MayBecome(from, to)) {
    return Refusal(version, from, to);
  }
  return Statement(db,
                   "UPDATE calibrations SET state = ?4 "
                   "WHERE rig = ?1 AND version = ?2 AND state = ?3",
                   rig,
                   version,
                   static_cast<int>(from) + 1,
                   static_cast<int>(to) + 1)
      .Run();
}

absl::Status MakeActive(Connection* db,
                        std::int64_t rig,
                        std::int64_t version,
                        CalibrationState from,
                        CalibrationState active_becomes) {
  if (!MayBecome(from, CalibrationState::kActive)) {
    return Refusal(version, from, CalibrationState::kActive);
  }
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t active, ActiveVersion(db, rig));
  SELFCAL_RETURN_IF_ERROR(
      ChangeState(db, rig, active, CalibrationState::kActive, active_becomes));
  SELFCAL_RETURN_IF_ERROR(
      ChangeState(db, rig, version, from, CalibrationState::kActive));
  return InsertActivation(db, rig, version);
}

absl::Status InsertActivation(Connection* db,
                              std::int64_t rig,
                              std::int64_t version) {
  return Statement(db,
                   "INSERT INTO activations (rig, version, time_ns) "
                   "VALUES (?1, ?2, ?3)",
                   rig,
                   version,
                   NowNs())
      .Run();
}

}  // namespace selfcal::server
