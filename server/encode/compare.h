// The answer to CompareCalibrations.
#pragma once

#include <absl/status/statusor.h>

#include "selfcal/v1/calibration_service.pb.h"
#include "server/store/store.h"

namespace selfcal::server {

// Two versions of one rig, with what the segments say that both came from
// (core/change/compare.h). Errors of the store.
absl::StatusOr<v1::CompareCalibrationsResponse> Compare(
    Store* store, const StoredCalibration& a, const StoredCalibration& b);

}  // namespace selfcal::server
