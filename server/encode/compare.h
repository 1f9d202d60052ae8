// The response to CompareCalibrations.
#pragma once

#include <absl/status/statusor.h>

#include "selfcal/v1/calibration_service.pb.h"
#include "server/store/store.h"

namespace selfcal::server {

// Compares two versions of one rig, given the information of the segments that
// both were computed from (core/change/compare.h). Returns errors of the store.
absl::StatusOr<v1::CompareCalibrationsResponse> Compare(
    Store* store, const StoredCalibration& a, const StoredCalibration& b);

}  // namespace selfcal::server
