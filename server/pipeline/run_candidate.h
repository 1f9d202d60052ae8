// The first phase of a run: the computation of its candidate.
#pragma once

#include <absl/status/statusor.h>

#include <optional>

#include "core/model/segment.h"
#include "server/pipeline/run_context.h"

namespace selfcal::server {

// Returns the stored candidate of the run, or computes and stores it. CANCELLED
// if the run is interrupted. If the data of a segment cannot be read for good,
// `damaged` is its key.
absl::StatusOr<StoredCalibration> EnsureCandidate(
    const RunContext& context,
    const StoredRun& run,
    std::optional<SegmentKey>* damaged);

}  // namespace selfcal::server
