// Changes of the device, in the database. All of it runs inside a transaction
// of the caller.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/change/detect_change.h"
#include "server/store/rigs.h"
#include "server/store/statement.h"
#include "server/store/store.h"

namespace selfcal::server {

// The number of the newest change of a rig, 0 if there is none.
absl::StatusOr<std::int64_t> NewestChange(Connection* db, std::int64_t rig);

// NOT_FOUND.
absl::StatusOr<StoredChange> ReadChange(Connection* db,
                                        const std::string& rig,
                                        std::int64_t change);

struct NewestJudged {
  std::optional<StoredChange> change;
  int quarantined = 0;  // segments
};

// Tests the newest scored segments of the rig against its active calibration,
// if that came of a run since the last change. Those that entered it are not
// looked at, nor what is damaged. One that shows another theta than both of its
// neighbours (core/change/isolated.h) is quarantined. Where the device has
// changed: writes the change and its event, and has the tables start anew with
// the segments after it.
absl::StatusOr<NewestJudged> JudgeNewest(Connection* db,
                                         const RigRow& rig,
                                         const ChangeOptions& options);

// Where the result of a run tells that the segments that it knows of differ
// (DeviceSplit), and the device has not been found changed since the run was
// created: writes the change, and so on.
absl::StatusOr<std::optional<StoredChange>> MaybeInsertSplit(
    Connection* db,
    const RigRow& rig,
    const StoredRun& run,
    const StoredCalibration& result,
    const ChangeOptions& options);

// The rest is not part of a transaction.

// Segments of a smaller sequence lie before the change; 0: there was none.
absl::StatusOr<std::int64_t> FirstSequenceSince(Connection* db,
                                                const std::string& rig,
                                                std::int64_t change);

// Store::ListHeldOut.
absl::StatusOr<std::vector<Store::HeldOut>> ListHeldOutRows(
    Connection* db, const std::string& rig, std::int64_t run, int limit);

}  // namespace selfcal::server
