#include "server/daemon/service_manager.h"

#include <systemd/sd-daemon.h>

#include <algorithm>
#include <cstdint>

namespace selfcal::server {

void NotifyStatus(const std::string& status) {
  sd_notify(0, ("STATUS=" + status).c_str());
}

void NotifyReady() { sd_notify(0, "READY=1\nSTATUS=serving"); }

void NotifyStopping() { sd_notify(0, "STOPPING=1\nSTATUS=stopping"); }

void NotifyAlive() { sd_notify(0, "WATCHDOG=1"); }

std::optional<std::chrono::milliseconds> WatchdogInterval() {
  std::uint64_t limit_us = 0;
  if (sd_watchdog_enabled(0, &limit_us) <= 0) return std::nullopt;
  // Notify twice within the limit.
  const auto half = static_cast<std::int64_t>(limit_us / 2000);
  return std::chrono::milliseconds(std::max<std::int64_t>(half, 1));
}

}  // namespace selfcal::server
