// Scores of kept segments at the present calibration.
#pragma once

#include <cstdint>

#include "core/model/calibration.h"
#include "server/domain/domain.h"
#include "server/pipeline/pipeline.h"
#include "server/store/rig_claim.h"

namespace selfcal::server {

// Scores again, at `theta`, all scored segments of the rig whose data is kept,
// as long as the version `active` is active. `theta` is this version, or a
// candidate that is about to take its place. Tables, change detection and
// predictions then rest on it, and the ends of a segment that loses its data
// were linearised near it. Segments whose data is damaged or gone keep their
// scores; any other error, and another active version or prior, end the
// rescoring, are logged, and make the result false. Does nothing if the
// estimators compute no ends.
bool RescoreKept(Domain* domain,
                 const Estimators& estimators,
                 const RigClaim& claim,
                 std::int64_t active,
                 const Calibration& theta);

// RescoreKept at the active version. The rig is recorded as one with outdated
// scores (server/domain/outdated_scores.h) until this succeeds, so that another
// call can take the place of one that fails or dies. Errors are logged.
void RescoreAtActive(Domain* domain,
                     const Estimators& estimators,
                     const RigClaim& claim);

}  // namespace selfcal::server
