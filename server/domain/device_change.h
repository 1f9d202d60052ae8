// Device changes: the device has another theta than before. They are found in
// the newest segments, or among those of a run; after one the tables and the
// memory start again with the segments after it.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <optional>

#include "core/change/detect_change.h"
#include "server/store/store.h"
#include "server/store/unit_of_work.h"

namespace selfcal::server {

// Covariance of a calibration at a later time: widened by the random walk of
// the rig since it was computed.
Eigen::MatrixXd CovarianceAt(const StoredRig& rig,
                             const StoredCalibration& calibration,
                             std::int64_t time_ns);

// Segments with a smaller sequence lie before the change; 0: there was none.
absl::StatusOr<std::int64_t> FirstSequenceSince(UnitOfWork* tx,
                                                std::int64_t change);

struct NewestExamined {
  std::optional<StoredChange> change;
  int quarantined = 0;  // segments
};

// Tests the newest scored segments of the rig against its active calibration,
// if that is the result of a run since the last change. Those that it was
// computed on are not examined, nor what is damaged. A segment that shows
// another theta than both of its neighbours (core/change/isolated.h) is
// quarantined. A change that is found is stored.
absl::StatusOr<NewestExamined> ExamineNewest(UnitOfWork* tx,
                                             const StoredRig& rig,
                                             const ChangeOptions& options);

// Stores the change that the result of a run shows among its segments
// (DeviceSplit), if it is sure enough and none was found since the run was
// created.
absl::StatusOr<std::optional<StoredChange>> StoreSplit(
    UnitOfWork* tx,
    const StoredRun& run,
    const StoredCalibration& result,
    const ChangeOptions& options);

}  // namespace selfcal::server
