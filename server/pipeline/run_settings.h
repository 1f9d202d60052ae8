// The settings of a run, for its provenance.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "core/calibration/calibrate.h"

namespace selfcal::server {

// Name and value of every setting that shapes the result. `change` is the
// device change whose earlier calibration is the prior; 0: none.
std::vector<std::pair<std::string, std::string>> RunSettings(
    const CalibrateOptions& options, std::int64_t change);

}  // namespace selfcal::server
