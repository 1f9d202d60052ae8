// Records of the versions of a calibration. They never change but for their
// state; triggers of the schema see to that, checksums notice the rest.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <optional>
#include <string>

#include "server/store/store.h"
#include "server/store/unit_of_work.h"

namespace selfcal::server {

// NOT_FOUND; DATA_LOSS if it is not as it was written.
absl::StatusOr<StoredCalibration> ReadCalibration(Connection* db,
                                                  const std::string& rig,
                                                  std::int64_t version);
absl::StatusOr<StoredCalibration> ReadActiveCalibration(Connection* db,
                                                        const std::string& rig);

// Newest first.
absl::StatusOr<Listed<StoredCalibration>> ListCalibrationRows(
    Connection* db, const std::string& rig, const Page& page);

// The version of the run's candidate; nothing if it has none.
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
// When it became active (StoredCalibration::activation).
absl::StatusOr<std::int64_t> ActivationTime(UnitOfWork* tx,
                                            std::int64_t activation);
// Of the database.
absl::StatusOr<std::int64_t> SchemaVersion(UnitOfWork* tx);

// Writes a version of that state with the segments of its run.
absl::Status InsertCalibration(UnitOfWork* tx,
                               const StoredCalibration& calibration);
// Reasons, validation and verdict of a candidate.
absl::Status InsertValidation(UnitOfWork* tx,
                              const StoredCalibration& calibration);
// Triggers of the schema refuse what the life of a calibration does not have.
absl::Status WriteState(UnitOfWork* tx,
                        std::int64_t version,
                        CalibrationState from,
                        CalibrationState to);
// A version became active: subscribers are notified in the order of these.
absl::Status InsertActivation(UnitOfWork* tx, std::int64_t version);
// A version keeps the first finding.
absl::Status InsertDisagreement(UnitOfWork* tx,
                                std::int64_t version,
                                const std::string& finding);

}  // namespace selfcal::server
