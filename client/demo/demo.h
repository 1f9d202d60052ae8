// The steps of the demo, from a device to a calibration that survives a kill.
#pragma once

#include <absl/status/status.h>

#include <string>

#include "client/demo/device.h"
#include "client/demo/report.h"

namespace selfcal::client {

struct DemoOptions {
  std::string daemon;      // path of selfcald
  std::string state_dir;   // a new folder
  double timeout_s = 900;  // for all scores and runs
};

// Starts the daemon, streams the device, waits for the run, shows the result,
// kills the daemon, restarts it and compares its state. An error ends the demo;
// a promise that did not hold sets report.failed().
absl::Status RunDemo(const DemoOptions& options,
                     const Device& device,
                     Report* report);

}  // namespace selfcal::client
