// Calibrates, or scores for a check, in a process of its own: the daemon lives
// on whatever becomes of the solver, what it took is given back whole, it can
// be limited in memory, be idle in CPU and I/O, and be ended at any instant.
//
// The worker is the same program with kWorkerArgument. It gets the job in a
// file without a name, tells its progress through a socket, and leaves the
// result in another such file. It dies with the thread that started it.
#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "core/calibration/calibrate.h"
#include "core/model/calibration.h"
#include "core/model/rig.h"
#include "core/model/segment.h"
#include "core/verify/scorer.h"

namespace selfcal::server {

inline constexpr char kWorkerArgument[] = "--worker";

struct WorkerLimits {
  // It takes only what nobody else wants: on a machine that is never idle it
  // does not get on. Otherwise it stands behind everything else.
  bool idle = true;
  std::int64_t max_memory_bytes = 0;  // besides what it starts with; 0: none
};

// As Calibrate() of core. `interrupted` is asked every few milliseconds; where
// it returns true the worker is killed, and the result is kCancelled. kFailed,
// with a message, where the worker ended without a result. Blocks; calls
// `progress` and `interrupted` on this thread. `command` starts the worker.
CalibrationResult CalibrateInWorker(const std::vector<std::string>& command,
                                    const WorkerLimits& limits,
                                    const Rig& rig,
                                    const Calibration& theta_start,
                                    const std::vector<MotionSegment>& segments,
                                    const CalibrateOptions& options,
                                    const ProgressCallback& progress,
                                    const std::function<bool()>& interrupted);

// As ScoreSegmentBy() of core, with `interrupted` as above: CANCELLED then.
// INTERNAL with a message where there is no score.
absl::StatusOr<SegmentInformation> ScoreInWorker(
    const std::vector<std::string>& command,
    const WorkerLimits& limits,
    ScorerKind scorer,
    const Rig& rig,
    const Calibration& theta0,
    const MotionSegment& segment,
    const std::function<bool()>& interrupted);

// The worker: what main() returns for kWorkerArgument. Call before any thread
// is started.
int RunWorker();

}  // namespace selfcal::server
