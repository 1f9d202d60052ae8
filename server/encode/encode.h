// Conversion of the store's records to messages of the contract.
#pragma once

#include <absl/status/statusor.h>

#include "core/calibration/calibrate.h"
#include "selfcal/v1/calibration_service.pb.h"
#include "selfcal/v1/recalibration.pb.h"
#include "selfcal/v1/rig.pb.h"
#include "selfcal/v1/segment.pb.h"
#include "selfcal/v1/store_service.pb.h"
#include "server/store/store.h"

namespace selfcal::server {

v1::Rig Encode(const StoredRig& rig);
v1::Segment Encode(const StoredSegment& segment);
v1::TableExclusion Encode(const std::string& rig, const Exclusion& exclusion);
v1::Event Encode(const StoredEvent& event);
v1::Table Encode(const std::string& rig, const Table& table);

v1::Calibration::State EncodeCalibrationState(CalibrationState state);

// Encodes all of a calibration but its estimates and their covariance.
v1::Calibration EncodeSummary(const StoredCalibration& calibration);
// Encodes a calibration with an estimate for each tangent component: its value,
// its difference from the factory value, its sigma from the covariance, and the
// random walk density that the rig states.
v1::Calibration Encode(const StoredCalibration& calibration,
                       const StoredRig& rig);
// Does the same, and reads the rig from the store.
absl::StatusOr<v1::Calibration> Encode(Store* store,
                                       const StoredCalibration& calibration);

// A version as it is at a temperature, and its rig: without slopes, with the
// covariance of the values there.
struct CalibrationAtTemperature {
  StoredCalibration calibration;
  StoredRig rig;
};
CalibrationAtTemperature AtTemperature(StoredCalibration calibration,
                                       StoredRig rig,
                                       double temperature_c);

// Encodes a run. `calibration` is its result; null if there is none yet.
v1::Recalibration Encode(const StoredRun& run,
                         const CalibrateProgress& progress,
                         const StoredCalibration* calibration);

// Does the same, with the solver's report, which it reads from the store.
absl::StatusOr<v1::Recalibration> EncodeWithReport(
    Store* store, const StoredRun& run, const CalibrateProgress& progress);
// The same with the iterations of the solver.
absl::StatusOr<v1::Recalibration> EncodeWithConvergence(Store* store,
                                                        const StoredRun& run);

}  // namespace selfcal::server
