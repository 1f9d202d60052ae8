// Deletes what an operator does not want to be stored any more.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <string>

#include "core/model/segment.h"
#include "server/store/unit_of_work.h"

namespace selfcal::server {

// Deletes a segment: its data, its score and its place in tables. Returns true
// if it was waiting for its score. NOT_FOUND; FAILED_PRECONDITION if a
// calibration was computed from it, or if a run that has not ended uses it.
absl::StatusOr<bool> DeleteSegment(UnitOfWork* tx,
                                   const SegmentKey& key,
                                   const std::string& caller,
                                   const std::string& reason);

// Deletes the rig with everything that is stored of it, except its events.
// Returns how many segments were waiting for their scores. FAILED_PRECONDITION
// if a run has not ended.
absl::StatusOr<int> DeleteRig(UnitOfWork* tx,
                              const std::string& caller,
                              const std::string& reason);

}  // namespace selfcal::server
