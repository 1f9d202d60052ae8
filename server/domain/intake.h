// Storing of received segments, within the quotas of the rig.
#pragma once

#include <absl/status/statusor.h>

#include "server/domain/domain_options.h"
#include "server/store/segment_rows.h"
#include "server/store/unit_of_work.h"

namespace selfcal::server {

// False if a segment with this key is stored already. RESOURCE_EXHAUSTED,
// naming the quota, if there is no room. FAILED_PRECONDITION for a rig that a
// device reports.
absl::StatusOr<bool> StoreSegment(UnitOfWork* tx,
                                  const NewSegment& segment,
                                  const Quotas& quotas);

}  // namespace selfcal::server
