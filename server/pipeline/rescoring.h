// Scores of kept segments about today's calibration.
#pragma once

#include <string>

#include "core/model/calibration.h"
#include "server/domain/domain.h"
#include "server/pipeline/pipeline.h"

namespace selfcal::server {

// Scores all segments of the rig whose data is kept anew, at `theta`: the
// calibration that is active, or about to be. Tables, change detection and
// predictions then stand on it, and what is remembered of a segment that loses
// its data was linearised near by. A segment that cannot be read, scored or
// written keeps the score that it has, and the log says why. Nothing where the
// estimators compute no ends.
void RescoreKept(Domain* domain,
                 const Estimators& estimators,
                 const std::string& rig,
                 const Calibration& theta);

}  // namespace selfcal::server
