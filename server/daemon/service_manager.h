// Notifications to systemd (sd_notify(3)). They do nothing if the daemon does
// not run under systemd.
#pragma once

#include <chrono>
#include <optional>
#include <string>

namespace selfcal::server {

void NotifyStatus(const std::string& status);
void NotifyReady();
void NotifyStopping();
void NotifyAlive();

// Interval at which NotifyAlive must be called; nullopt without a watchdog.
std::optional<std::chrono::milliseconds> WatchdogInterval();

}  // namespace selfcal::server
