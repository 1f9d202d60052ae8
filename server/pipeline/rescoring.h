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
// scores; any other error, and another active version, end the rescoring and
// are logged. Does nothing if the estimators compute no ends.
void RescoreKept(Domain* domain,
                 const Estimators& estimators,
                 const RigClaim& claim,
                 std::int64_t active,
                 const Calibration& theta);

}  // namespace selfcal::server
