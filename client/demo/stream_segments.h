// Streams segments to a daemon, and shows how it processes them.
#pragma once

#include <absl/status/statusor.h>

#include <string>
#include <vector>

#include "client/demo/daemon_view.h"
#include "client/demo/report.h"
#include "core/model/segment.h"
#include "selfcal/v1/recalibration.pb.h"

namespace selfcal::client {

// Returns when all segments are scored and no run is unfinished, with the runs
// that began meanwhile, oldest first. INVALID_ARGUMENT if the daemon rejects a
// segment, DEADLINE_EXCEEDED after `timeout_s`.
absl::StatusOr<std::vector<v1::Recalibration>> StreamSegments(
    const std::string& target,
    const std::string& rig,
    const std::vector<MotionSegment>& segments,
    double timeout_s,
    Report* report);

// Shows the iterations of a run until it has ended, and its result.
absl::StatusOr<v1::Recalibration> FollowRun(DaemonView& view,
                                            const std::string& name,
                                            Report* report);

}  // namespace selfcal::client
