// Device changes: the device has another theta than before. They are detected
// among the newest segments, or among the segments of a run. Afterwards the
// tables and the remembered segments start again with those after the change.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <optional>

#include "core/change/detect_change.h"
#include "server/store/store.h"
#include "server/store/unit_of_work.h"

namespace selfcal::server {

// Covariance of a calibration at the steady time `time_ns`: increased by the
// random walk of the rig since the calibration was computed.
Eigen::MatrixXd CovarianceAt(const StoredRig& rig,
                             const StoredCalibration& calibration,
                             std::int64_t time_ns);

// The first sequence after the device change: segments with a smaller one lie
// before it. `change` is 0 if there was none.
absl::StatusOr<std::int64_t> FirstSequenceSince(UnitOfWork* tx,
                                                std::int64_t change);

struct NewestExamined {
  std::optional<StoredChange> change;
  int quarantined = 0;  // segments
};

// Tests the newest scored segments of the rig against its active calibration,
// if that is the result of a run since the last device change and has measured
// the track noise. Segments that it was computed on, and if it rests on
// remembered ones all up to the newest of these, are left out, as are damaged
// ones, misfits and those that cannot be tested against it. A segment that
// shows another theta than both of its neighbours (core/change/isolated.h) is
// quarantined; the first and the last one, which have one neighbour, are only
// left out. A device change that is detected is stored.
absl::StatusOr<NewestExamined> ExamineNewest(UnitOfWork* tx,
                                             const StoredRig& rig,
                                             const ChangeOptions& options);

// Stores the device change that the result of a run shows among its segments
// (DeviceSplit), if chance explains it rarely enough, no change was stored
// since the run was created, and its first segment still exists. What remains
// known is what the newest version knows that rests on none of the segments
// since (StoredChange::base_version).
absl::StatusOr<std::optional<StoredChange>> StoreSplit(
    UnitOfWork* tx,
    const StoredRun& run,
    const StoredCalibration& result,
    const ChangeOptions& options);

}  // namespace selfcal::server
