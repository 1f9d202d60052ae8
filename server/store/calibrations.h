// Versions of a calibration, in the database. They never change but for their
// state; triggers of the schema see to that, checksums notice the rest.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <optional>
#include <string>

#include "server/store/statement.h"
#include "server/store/store.h"

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

// The rest runs inside a transaction of the caller.

absl::StatusOr<std::int64_t> ActiveVersion(Connection* db, std::int64_t rig);

absl::StatusOr<std::int64_t> NextVersion(Connection* db, std::int64_t rig);

// Writes the factory's version, active, and the event.
absl::Status InsertFactory(Connection* db,
                           std::int64_t rig,
                           const StoredCalibration& calibration);

// Writes a version of that state with the segments of its run.
absl::Status InsertCalibration(Connection* db,
                               std::int64_t rig,
                               const StoredCalibration& calibration);

// The version of the run's candidate, nothing if it has none.
absl::StatusOr<std::optional<std::int64_t>> CandidateOfRun(Connection* db,
                                                           std::int64_t rig,
                                                           std::int64_t run);

// Candidate -> active or rejected, as its state says, with its reasons and
// validation, and the event. What was active is superseded.
absl::Status JudgeCandidate(Connection* db,
                            std::int64_t rig,
                            const StoredCalibration& judged);

}  // namespace selfcal::server
