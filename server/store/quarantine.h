// Segments that are taken out of everything, in the database: damaged ones,
// those that contradict the others, and those that an operator names.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <string>
#include <vector>

#include "core/calibration/segment_fit.h"
#include "server/store/statement.h"
#include "server/store/store.h"

namespace selfcal::server {

// All of it runs inside a transaction of the caller.

// Any state -> unusable, out of all tables. Its data stays until
// DropUnreferencedPayloads.
absl::Status MakeUnusable(Connection* db,
                          std::int64_t segment,
                          const std::string& problem);

// The same with an event: kSegmentUnusable for one that is damaged or cannot be
// scored, kSegmentQuarantined for one that contradicts others.
absl::Status SetAside(Connection* db,
                      const std::string& rig,
                      const SegmentKey& key,
                      std::int64_t segment,
                      EventKind event,
                      const std::string& problem);

// Quarantines the segments of a run that its result does not use, with an event
// each.
absl::Status QuarantineExcluded(Connection* db,
                                std::int64_t rig,
                                const StoredRun& run,
                                const std::vector<SegmentFit>& fits);

// Those of a run's snapshot that are unusable by now, in order of arrival.
absl::StatusOr<std::vector<SegmentKey>> UnusableSegments(Connection* db,
                                                         std::int64_t rig,
                                                         std::int64_t run);

}  // namespace selfcal::server
