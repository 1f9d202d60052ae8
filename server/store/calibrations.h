// Records of calibration versions. Once written, only their state changes:
// triggers of the schema enforce this, and checksums detect any other
// modification.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "server/store/store.h"
#include "server/store/unit_of_work.h"

namespace selfcal::server {

// NOT_FOUND; DATA_LOSS if the record is damaged.
absl::StatusOr<StoredCalibration> ReadCalibration(Connection* db,
                                                  const std::string& rig,
                                                  std::int64_t version);
absl::StatusOr<StoredCalibration> ReadActiveCalibration(Connection* db,
                                                        const std::string& rig);

// Store::WasActive.
absl::StatusOr<bool> WasActive(Connection* db,
                               const std::string& rig,
                               std::int64_t version);

// Store::GetReports.
absl::StatusOr<std::vector<StoredCalibration>> ReadReports(
    Connection* db, const std::vector<VersionId>& versions);

// Store::ListCalibrations.
absl::StatusOr<Listed<StoredCalibration>> ListCalibrationRows(
    Connection* db,
    const std::string& rig,
    const CalibrationQuery& query,
    const Page& page,
    const RigQuery& of,
    CalibrationParts parts);
// Store::ListIncompleteVersions.
absl::StatusOr<std::vector<VersionId>> IncompleteVersions(Connection* db,
                                                          int limit);

// The version of the run's candidate; nullopt if it has none.
absl::StatusOr<std::optional<std::int64_t>> CandidateOfRun(Connection* db,
                                                           std::int64_t rig,
                                                           std::int64_t run);

// Store::GetCandidate.
absl::StatusOr<StoredCalibration> CandidateCalibration(Connection* db,
                                                       const std::string& rig,
                                                       std::int64_t run);

// --- Within a unit of work.

absl::StatusOr<StoredCalibration> ReadCalibration(UnitOfWork* tx,
                                                  std::int64_t version);
absl::StatusOr<StoredCalibration> ReadActiveCalibration(UnitOfWork* tx);
absl::StatusOr<std::int64_t> ActiveVersion(UnitOfWork* tx);
absl::StatusOr<std::int64_t> NextVersion(UnitOfWork* tx);
absl::StatusOr<std::optional<std::int64_t>> CandidateOfRun(UnitOfWork* tx,
                                                           std::int64_t run);
// Steady time of an activation (StoredCalibration::activation).
absl::StatusOr<std::int64_t> ActivationSteadyTime(UnitOfWork* tx,
                                                  std::int64_t activation);
// Schema version of the database.
absl::StatusOr<std::int64_t> SchemaVersion(UnitOfWork* tx);

// Writes a version, in the state that it has, with the segments of its run.
absl::Status InsertCalibration(UnitOfWork* tx,
                               const StoredCalibration& calibration);
// Writes the columns by which lists find a version: the verdict of its
// validation, and the mean temperature of its segments.
absl::Status WriteListColumns(UnitOfWork* tx,
                              const StoredCalibration& calibration);
// Writes the reasons, validation and verdict of a candidate.
absl::Status InsertValidation(UnitOfWork* tx,
                              const StoredCalibration& calibration);
// Triggers of the schema refuse transitions that do not exist.
absl::Status WriteState(UnitOfWork* tx,
                        std::int64_t version,
                        CalibrationState from,
                        CalibrationState to);
// Records that a version became active. Subscribers are notified in the order
// of these records.
absl::Status InsertActivation(UnitOfWork* tx, std::int64_t version);
// Records StoredCalibration::finding; a version keeps the first one.
absl::Status InsertFinding(UnitOfWork* tx,
                           std::int64_t version,
                           const std::string& finding);

}  // namespace selfcal::server
