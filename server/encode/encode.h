// What the store keeps, as the messages of the contract.
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
v1::TableExclusion Encode(const TableAbsence& absence);
v1::Event Encode(const StoredEvent& event);
v1::Table Encode(const std::string& rig, const Table& table);

// With an estimate for each tangent component, also as its difference from the
// factory's value of its rig, sigmas from the covariance, and the walk that the
// rig states.
v1::Calibration Encode(const StoredCalibration& calibration,
                       const StoredRig& rig);
// The same with its rig.
absl::StatusOr<v1::Calibration> Encode(Store* store,
                                       const StoredCalibration& calibration);

// `calibration` is the one that the run produced, null if there is none yet.
v1::Recalibration Encode(const StoredRun& run,
                         const CalibrateProgress& progress,
                         const StoredCalibration* calibration);

// The same with what the store keeps of the calibration: the solver's report.
absl::StatusOr<v1::Recalibration> EncodeWithReport(
    Store* store, const StoredRun& run, const CalibrateProgress& progress);

}  // namespace selfcal::server
