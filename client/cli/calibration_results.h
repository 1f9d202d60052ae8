// The results of a calibration, written to a folder.
#pragma once

#include <optional>
#include <string>

#include "client/cli/context.h"

namespace selfcal::client {

// Writes the active version: report.html, calibration.json, and a folder for
// each tool whose files can express it; losses are printed. Files of an earlier
// call are replaced. Returns kDone for a good version, kWeak for a weak one,
// and kFailed if it is not trustworthy, if only the factory calibration is
// there, or after an error.
int WriteResults(Context* context,
                 const std::string& rig,
                 const std::string& folder,
                 std::optional<double> imu_rate_hz);

}  // namespace selfcal::client
