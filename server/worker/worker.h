// Calibrates, or scores for a verification, in a separate process: the daemon
// survives any failure of the solver, all of the solver's memory is released,
// and the process can be limited in memory, run at idle priority of CPU and
// I/O, and be killed at any time.
//
// The worker is the same program with kWorkerArgument. It receives the job and
// its segments, one at a time, through a socket, reports its progress through
// another, and writes the result to an anonymous file. It dies with the thread
// that started it.
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
#include "server/store/segment_source.h"

namespace selfcal::server {

inline constexpr char kWorkerArgument[] = "--worker";

struct WorkerLimits {
  // If true, the worker uses only idle resources and makes no progress on a
  // machine that is never idle; otherwise it has a lower priority than others.
  bool idle = true;
  // Limit on the memory beyond that at the start, the segments included; 0: no
  // limit.
  std::int64_t max_memory_bytes = 0;
};

// Like Calibrate() of core. `interrupted` is called every few milliseconds; if
// it returns true, the worker is killed and the result is kCancelled. The
// result is kFailed, with a message, if the worker ended without a result. An
// error is that of `segments`. Blocks, and calls `segments`, `progress` and
// `interrupted` on this thread. `command` starts the worker.
absl::StatusOr<CalibrationResult> CalibrateInWorker(
    const std::vector<std::string>& command,
    const WorkerLimits& limits,
    const Rig& rig,
    const Calibration& theta_start,
    const SegmentSource& segments,
    const CalibrateOptions& options,
    const ProgressCallback& progress,
    const std::function<bool()>& interrupted);

// Like ScoreSegmentBy() of core. CANCELLED if `interrupted`, as above, returns
// true; INTERNAL with a message if there is no score.
absl::StatusOr<SegmentInformation> ScoreInWorker(
    const std::vector<std::string>& command,
    const WorkerLimits& limits,
    ScorerKind scorer,
    const Rig& rig,
    const Calibration& theta0,
    const MotionSegment& segment,
    const std::function<bool()>& interrupted);

// Runs the worker, if main() is called with kWorkerArgument; returns the exit
// code. Call it before any thread is started.
int RunWorker();

}  // namespace selfcal::server
