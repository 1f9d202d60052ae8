// What systemd is told about the daemon, where it runs under it (sd_notify(3));
// otherwise nothing happens.
#pragma once

#include <chrono>
#include <optional>
#include <string>

namespace selfcal::server {

void NotifyStatus(const std::string& status);
void NotifyReady();
void NotifyStopping();
void NotifyAlive();

// How often NotifyAlive is due; nothing without a watchdog.
std::optional<std::chrono::milliseconds> WatchdogInterval();

}  // namespace selfcal::server
