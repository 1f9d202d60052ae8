// The main job, step by step, as someone watches it.
#pragma once

#include <absl/status/status.h>

#include <string>

#include "client/demo/device.h"
#include "client/demo/report.h"

namespace selfcal::client {

struct DemoOptions {
  std::string daemon;      // path of selfcald
  std::string state_dir;   // fresh
  double timeout_s = 900;  // for all scores and runs
};

// Starts the daemon, streams the device, waits for the recalibration, shows
// the result, kills the daemon, starts it again and compares. An error ends it;
// what did not hold is in report.failed().
absl::Status RunDemo(const DemoOptions& options,
                     const Device& device,
                     Report* report);

}  // namespace selfcal::client
