// Results of runs: a calibration is first a candidate, then validated.
#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <string>

#include "core/change/detect_change.h"
#include "server/store/store.h"
#include "server/store/unit_of_work.h"

namespace selfcal::server {

// As the methods of Domain.
absl::StatusOr<StoredCalibration> StoreCandidate(
    UnitOfWork* tx, std::int64_t run, const StoredCalibration& calibration);
absl::StatusOr<StoredCalibration> FinishRun(
    UnitOfWork* tx,
    std::int64_t run,
    const StoredCalibration& calibration,
    const std::string& finding,
    const ChangeOptions& options);

}  // namespace selfcal::server
