// Conditions of the machine, power and load, that defer automatic runs.
#pragma once

#include <filesystem>
#include <memory>

#include "server/pipeline/pipeline.h"

namespace selfcal::server {

struct HostLimits {
  // Defers runs while the machine runs on its battery.
  bool only_on_external_power = false;
  // Defers runs while the load average of the last minute, per processor, is
  // this or more; 0: no limit.
  double max_load = 0;

  friend bool operator==(const HostLimits&, const HostLimits&) = default;
};

// The files in which the kernel reports power and load.
struct HostFiles {
  std::filesystem::path power_supplies = "/sys/class/power_supply";
  std::filesystem::path load = "/proc/loadavg";
};

// Any thread may call. If the load cannot be read, runs are deferred with a
// message that says so; a host without a folder of power supplies has no
// battery.
std::unique_ptr<Conditions> MakeHostConditions(const HostLimits& limits,
                                               const HostFiles& files = {});

}  // namespace selfcal::server
