// Quarantine: segments that are not used any more. It is final: nothing undoes
// it, but the data can be sent again under another session.
//
// Decided by FindContradictions and FindMisfits (core/calibration/
// segment_agreement.h) for the segments of a run, by FindIsolated
// (core/change/isolated.h) for the newest ones, or by an operator. Segments
// that are damaged or cannot be scored are unusable like them
// (Domain::MarkUnusable).
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/calibration/segment_fit.h"
#include "server/store/segment_rows.h"
#include "server/store/store.h"
#include "server/store/unit_of_work.h"

namespace selfcal::server {

// Result of a quarantine by an operator.
struct QuarantineCommit {
  std::int64_t quarantined = 0;
  std::int64_t unusable = 0;  // those unusable before
  // The quarantined ones that were waiting for their score.
  std::vector<std::int64_t> unscored_sequences;
};

// Any state -> unusable; removes the segment from all tables and appends an
// event: kSegmentUnusable if it is damaged or cannot be scored,
// kSegmentQuarantined if it contradicts others or an operator named it. Its
// data stays until DropUnneededData.
absl::Status Quarantine(UnitOfWork* tx,
                        const SegmentRow& segment,
                        EventKind event,
                        const std::string& problem);

// Quarantines the segments of a run that its result does not use.
absl::Status QuarantineExcluded(UnitOfWork* tx,
                                std::int64_t run,
                                const std::vector<SegmentFit>& fits);

// Domain::MarkUnusable.
absl::Status MarkUnusable(UnitOfWork* tx,
                          const SegmentKey& key,
                          const std::string& problem);

// Domain::QuarantineSegments.
absl::StatusOr<QuarantineCommit> QuarantineSegments(
    UnitOfWork* tx,
    const std::string& session,
    std::optional<std::int64_t> index,
    const std::string& caller,
    const std::string& reason);

}  // namespace selfcal::server
