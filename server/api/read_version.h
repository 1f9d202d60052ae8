// Reads the version of a calibration that a request names. Internal to
// server/api.
#pragma once

#include <absl/status/statusor.h>

#include <string>
#include <string_view>

#include "server/store/store.h"

namespace selfcal::server {

// `name` is rigs/{rig}/calibrations/{version}, {version} a number or `active`;
// `field` is the field of the request that holds it.
absl::StatusOr<StoredCalibration> ReadVersion(Store* store,
                                              std::string_view field,
                                              const std::string& name);

}  // namespace selfcal::server
