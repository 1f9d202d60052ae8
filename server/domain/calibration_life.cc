#include "server/domain/calibration_life.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <iterator>

#include "server/domain/outdated_scores.h"
#include "server/status/status_macros.h"
#include "server/store/calibrations.h"
#include "server/store/events.h"

namespace selfcal::server {
namespace {

struct Transition {
  CalibrationState from;
  CalibrationState to;
};

// The same as in migrations/sqlite/0004_lifecycle.sql.
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

absl::Status ChangeState(UnitOfWork* tx,
                         std::int64_t version,
                         CalibrationState from,
                         CalibrationState to) {
  if (!MayBecome(from, to)) {
    return Refusal(version, from, to);
  }
  return WriteState(tx, version, from, to);
}

// Makes a version the active one. `from` is its present state.
absl::Status MakeActive(UnitOfWork* tx,
                        std::int64_t version,
                        CalibrationState from) {
  if (!MayBecome(from, CalibrationState::kActive)) {
    return Refusal(version, from, CalibrationState::kActive);
  }
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t active, ActiveVersion(tx));
  SELFCAL_RETURN_IF_ERROR(ChangeState(
      tx, active, CalibrationState::kActive, StateOfReplaced(active, version)));
  SELFCAL_RETURN_IF_ERROR(
      ChangeState(tx, version, from, CalibrationState::kActive));
  return InsertActivation(tx, version);
}

absl::Status AppendPublished(UnitOfWork* tx, std::int64_t version) {
  return AppendEvent(
      tx, EventKind::kCalibrationPublished, fmt::format("version {}", version));
}

}  // namespace

bool MayBecome(CalibrationState from, CalibrationState to) {
  return std::any_of(
      std::begin(kTransitions), std::end(kTransitions), [&](const auto& t) {
        return t.from == from && t.to == to;
      });
}

CalibrationState StateOfReplaced(std::int64_t active, std::int64_t version) {
  return version < active ? CalibrationState::kRolledBack
                          : CalibrationState::kSuperseded;
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

absl::Status StoreFactoryCalibration(UnitOfWork* tx, const StoredRig& rig) {
  Eigen::VectorXd variances =
      Eigen::VectorXd::Zero(TangentSize(rig.rig.factory));
  const Eigen::VectorXd sigmas = PriorSigmas(rig.rig);
  for (const int component : FreeComponents(rig.rig)) {
    variances[component] = sigmas[component] * sigmas[component];
  }
  StoredCalibration factory;
  factory.rig = tx->rig();
  factory.version = 1;
  factory.state = CalibrationState::kActive;
  factory.create_time_ns = rig.create_time_ns;
  factory.create_steady_ns = tx->now().steady_ns;
  factory.theta = rig.rig.factory;
  factory.covariance = variances.asDiagonal();
  SELFCAL_RETURN_IF_ERROR(InsertCalibration(tx, factory));
  SELFCAL_RETURN_IF_ERROR(InsertActivation(tx, factory.version));
  return AppendPublished(tx, factory.version);
}

absl::Status EndValidation(UnitOfWork* tx, const StoredCalibration& validated) {
  SELFCAL_RETURN_IF_ERROR(InsertValidation(tx, validated));
  if (validated.state == CalibrationState::kActive) {
    SELFCAL_RETURN_IF_ERROR(
        MakeActive(tx, validated.version, CalibrationState::kCandidate));
    return AppendPublished(tx, validated.version);
  }
  SELFCAL_RETURN_IF_ERROR(ChangeState(
      tx, validated.version, CalibrationState::kCandidate, validated.state));
  return AppendEvent(tx,
                     EventKind::kCalibrationRejected,
                     fmt::format("version {}: {}",
                                 validated.version,
                                 fmt::join(validated.reasons, " ")));
}

absl::StatusOr<StoredCalibration> ActivateCalibration(
    UnitOfWork* tx,
    std::int64_t version,
    const std::string& caller,
    const std::string& reason) {
  SELFCAL_ASSIGN_OR_RETURN(const StoredCalibration chosen,
                           ReadCalibration(tx, version));
  if (chosen.state == CalibrationState::kActive) {
    return chosen;
  }
  if (chosen.state == CalibrationState::kCandidate) {
    return absl::FailedPreconditionError(fmt::format(
        "calibration {} of rig {} is not validated yet; wait for its run",
        version,
        tx->rig()));
  }
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t active, ActiveVersion(tx));
  const bool back = version < active;
  SELFCAL_RETURN_IF_ERROR(MakeActive(tx, version, chosen.state));
  SELFCAL_RETURN_IF_ERROR(NoteOutdatedScores(tx));
  SELFCAL_RETURN_IF_ERROR(
      AppendEvent(tx,
                  back ? EventKind::kCalibrationRolledBack
                       : EventKind::kCalibrationActivated,
                  fmt::format("version {} in place of {} by {}: {}",
                              version,
                              active,
                              caller,
                              reason)));
  return ReadCalibration(tx, version);
}

absl::Status ReportDisagreement(UnitOfWork* tx,
                                std::int64_t version,
                                const std::string& finding) {
  SELFCAL_RETURN_IF_ERROR(ReadCalibration(tx, version).status());
  SELFCAL_RETURN_IF_ERROR(InsertFinding(tx, version, finding));
  return AppendEvent(tx,
                     EventKind::kCoresDisagree,
                     fmt::format("version {}: {}", version, finding));
}

}  // namespace selfcal::server
