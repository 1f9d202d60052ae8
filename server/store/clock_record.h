// The record of the clock of the device, from which steady time continues after
// a restart (server/domain/device_clock.h).
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <optional>
#include <string>

namespace selfcal::server {

class Connection;  // driver/driver.h

// All clocks at one moment [ns].
struct ClockRecord {
  std::string boot;  // names the time since the machine was booted
  std::int64_t since_boot_ns = 0;  // with the time that it slept
  std::int64_t time_ns = 0;        // wall clock, since the Unix epoch
  std::int64_t steady_ns = 0;      // steady time
  // Nothing is removed for its age before this steady time.
  std::int64_t keep_until_ns = 0;

  friend bool operator==(const ClockRecord&, const ClockRecord&) = default;
};

// nullopt if there is none.
absl::StatusOr<std::optional<ClockRecord>> ReadClockRecord(Connection* db);
absl::Status WriteClockRecord(Connection* db, const ClockRecord& clock);

}  // namespace selfcal::server
