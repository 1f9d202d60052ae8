// Whether the machine has power and time to spare for a run that nobody asked
// for by hand.
#pragma once

#include <filesystem>
#include <memory>

#include "server/pipeline/pipeline.h"

namespace selfcal::server {

struct HostLimits {
  // Only while no battery is what the machine runs on.
  bool only_on_external_power = false;
  // Only while the load of the last minute is below this, for each processor;
  // 0: no matter.
  double max_load = 0;

  friend bool operator==(const HostLimits&, const HostLimits&) = default;
};

// Where the kernel tells.
struct HostFiles {
  std::filesystem::path power_supplies = "/sys/class/power_supply";
  std::filesystem::path load = "/proc/loadavg";
};

// Any thread may ask. What cannot be read holds runs back, and says so: a limit
// that was asked for is kept.
std::unique_ptr<Conditions> MakeHostConditions(const HostLimits& limits,
                                               const HostFiles& files = {});

}  // namespace selfcal::server
