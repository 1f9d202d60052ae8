// Steady time: the wall clock of the device without its jumps. Ages are
// differences of it, so that a wall clock that is set (a device without a
// battery for its clock, when it first reaches a time server) makes nothing
// older or younger.
//
// Until the machine is booted again it advances with the time since then. Over
// a boot it advances by the wall clock: the device was off. A wall clock that
// went back meanwhile, or forward by more than kMaxTimeOff, is not believed;
// steady time continues where it was.
#pragma once

#include <absl/status/status.h>

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "server/store/clock_record.h"
#include "server/store/moment.h"
#include "server/store/store.h"

namespace selfcal::server {

// A wall clock that jumps by more has stepped.
constexpr std::int64_t kClockStep_ns =
    std::chrono::nanoseconds(std::chrono::hours(1)).count();
// Nothing is removed for its age for so long after a step.
constexpr std::int64_t kKeepAfterStep_ns =
    std::chrono::nanoseconds(std::chrono::hours(24)).count();
// A device is believed to have been off for no longer.
constexpr std::int64_t kMaxTimeOff_ns = 366 * kKeepAfterStep_ns;

// The clocks of the machine at one moment.
struct ClockReading {
  std::string boot;  // names the time since the machine was booted
  std::int64_t since_boot_ns = 0;
  std::int64_t time_ns = 0;  // wall clock, since the Unix epoch
};

struct ClockAdvance {
  ClockRecord clock;
  // A sentence about the step of the wall clock, if there was one.
  std::optional<std::string> step;
};

// The record at `reading` that follows `last`.
ClockAdvance AdvanceClock(const ClockRecord& last, const ClockReading& reading);

// Keeps the record in the store. Any thread may call.
class DeviceClock {
 public:
  // `read` reads the clocks of the machine; `store` must outlive the result.
  static absl::StatusOr<std::unique_ptr<DeviceClock>> Open(
      Store* store, std::function<ClockReading()> read);

  Moment Now() const;

  // Looks whether the wall clock has stepped, which becomes an event, and
  // returns what it did. Writes the record after a step, and once an hour;
  // after an error no more often than once a minute.
  absl::StatusOr<std::optional<std::string>> Observe();

 private:
  DeviceClock(Store* store,
              std::function<ClockReading()> read,
              const ClockRecord& last);
  absl::Status Write(const ClockAdvance& advance);

  Store* const store_;
  const std::function<ClockReading()> read_;
  mutable std::mutex mutex_;
  ClockRecord last_;              // as it is in the store
  std::int64_t retry_at_ns_ = 0;  // since the boot, after an error
};

}  // namespace selfcal::server
