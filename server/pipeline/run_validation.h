// The second phase of a run: its candidate is validated against the active
// version, and stored as a version.
#pragma once

#include <absl/status/statusor.h>

#include "server/pipeline/run_context.h"

namespace selfcal::server {

// Ends the run with the candidate, which becomes the active version or is
// rejected. Validates again if another version becomes active meanwhile. Before
// a version becomes active, the kept segments are scored at it.
absl::StatusOr<StoredCalibration> ValidateAndFinish(
    const RunContext& context,
    const StoredRun& run,
    StoredCalibration candidate);

}  // namespace selfcal::server
