// The life of a calibration:
//
//   candidate -> active       validation passed
//   candidate -> rejected     validation failed; final
//   active -> superseded      a newer one became active
//   active -> rolled back     an older one was activated manually
//   superseded -> active      manually
//   rolled back -> active     manually
//
// The factory calibration begins as active, every other as a candidate.
// Triggers of the schema refuse everything else.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <string>

#include "server/store/store.h"
#include "server/store/unit_of_work.h"

namespace selfcal::server {

bool MayBecome(CalibrationState from, CalibrationState to);

// The state of the active version once `version` has replaced it.
CalibrationState StateOfReplaced(std::int64_t active, std::int64_t version);

// "rolled back".
const char* StateName(CalibrationState state);

// Writes the factory calibration of a new rig as its active one; its covariance
// is that of the tolerances.
absl::Status StoreFactoryCalibration(UnitOfWork* tx, const StoredRig& rig);

// Candidate -> active or rejected, as the state of `validated` says; writes its
// reasons, its validation and the event. The version that was active is
// superseded.
absl::Status EndValidation(UnitOfWork* tx, const StoredCalibration& validated);

// Domain::ActivateCalibration.
absl::StatusOr<StoredCalibration> ActivateCalibration(
    UnitOfWork* tx,
    std::int64_t version,
    const std::string& caller,
    const std::string& reason);

// Domain::ReportDisagreement.
absl::Status ReportDisagreement(UnitOfWork* tx,
                                std::int64_t version,
                                const std::string& finding);

}  // namespace selfcal::server
