// Executes one run from beginning to end.
#pragma once

#include "server/pipeline/run_context.h"

namespace selfcal::server {

// After so many attempts, each ended by a crash of the daemon, a run fails.
inline constexpr int kMaxRunAttempts = 3;

// In the order of how much is left to do.
enum class Execution { kDone, kDeferred, kTryLater };

// Executes an unfinished run on the calling thread, and publishes what happens.
// It is deferred if it may not begin yet; its message says why. After a
// transient failure it stays unfinished, for a later try.
Execution ExecuteRun(const RunContext& context,
                     Watchers<StoredCalibration>* calibration_watchers,
                     const StoredRun& pending);

}  // namespace selfcal::server
