// The options that a run calibrates with.
#pragma once

#include <absl/status/statusor.h>

#include "core/calibration/calibrate.h"
#include "server/domain/domain.h"

namespace selfcal::server {

// `options` with the additions of rig and run: the remembered segments, and,
// after a device change, what is still known. Errors of the store.
absl::StatusOr<CalibrateOptions> OptionsOfRun(Domain* domain,
                                              CalibrateOptions options,
                                              const StoredRig& rig,
                                              const StoredRun& run);

}  // namespace selfcal::server
