// Versions of a calibration, in the database. They never change but for their
// state; triggers of the schema see to that, checksums notice the rest.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
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

// Writes a version with the segments of its run, and the event. An active one
// supersedes the active one before.
absl::Status InsertCalibration(Connection* db,
                               std::int64_t rig,
                               const StoredCalibration& calibration);

}  // namespace selfcal::server
