// Reads the rows of calibration versions. Internal to calibrations.h.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "server/store/driver/statement.h"
#include "server/store/store.h"

namespace selfcal::server {

// A function of records.h that parses the content of a version, or some of it.
using CalibrationParser = absl::StatusOr<StoredCalibration> (*)(
    std::string_view bytes, const std::string& what);

// Selects versions `c` of rigs `g`, for CalibrationFromRow; without a
// condition.
std::string SelectCalibrations();
// Reads all but the segments. DATA_LOSS if the record is damaged.
absl::StatusOr<StoredCalibration> CalibrationFromRow(const Statement& row,
                                                     CalibrationParser parse);

// Adds the segments that the versions come from, with their temperatures.
absl::Status ReadOrigins(Connection* db,
                         std::vector<StoredCalibration>* calibrations);

// Parses the content of a version, which this column has; the next one has its
// checksum. DATA_LOSS if it is damaged.
absl::StatusOr<StoredCalibration> ParseContent(const Statement& row,
                                               int content,
                                               const std::string& rig,
                                               std::int64_t version,
                                               CalibrationParser parse);

}  // namespace selfcal::server
