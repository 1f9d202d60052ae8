// One session of a simulated device, streamed to a daemon that is running.
#pragma once

#include <absl/status/status.h>

#include <string>

#include "client/demo/device.h"
#include "client/demo/report.h"

namespace selfcal::client {

struct StreamOptions {
  std::string target;  // in the syntax of gRPC, without TLS
  std::string rig;
  SimulatedUse use;
  double timeout_s = 900;  // for all scores and runs
};

// Creates the rig if there is none of the name, streams the session as a SLAM
// system that runs on the active calibration does, and waits until all is
// scored and no run is unfinished. The last line is the active version with its
// verdict.
absl::Status StreamDevice(const StreamOptions& options, Report* report);

}  // namespace selfcal::client
