// The options that a run calibrates with.
#pragma once

#include <absl/status/statusor.h>

#include "core/calibration/calibrate.h"
#include "server/domain/domain.h"

namespace selfcal::server {

// `options` with what rig and run add to them: what is remembered of segments
// without data, and, after a change of the device, what is still known. Errors
// of the store.
absl::StatusOr<CalibrateOptions> OptionsOfRun(Domain* domain,
                                              CalibrateOptions options,
                                              const StoredRig& rig,
                                              const StoredRun& run);

}  // namespace selfcal::server
