#include "server/domain/device_clock.h"

#include <fmt/chrono.h>

#include <chrono>
#include <cstdlib>
#include <utility>

#include "server/status/status_macros.h"

namespace selfcal::server {
namespace {

constexpr std::int64_t kRecordInterval_ns =
    std::chrono::nanoseconds(std::chrono::hours(1)).count();
constexpr std::int64_t kRetry_ns =
    std::chrono::nanoseconds(std::chrono::minutes(1)).count();

bool IsSameBoot(const ClockRecord& last, const ClockReading& reading) {
  return reading.boot == last.boot &&
         reading.since_boot_ns >= last.since_boot_ns;
}

std::string TimeText(std::int64_t time_ns) {
  const std::chrono::sys_time<std::chrono::nanoseconds> time{
      std::chrono::nanoseconds(time_ns)};
  return fmt::format("{:%FT%TZ}",
                     std::chrono::floor<std::chrono::seconds>(time));
}

// Steady time since `last`; nullopt if it cannot be known, since the machine
// was booted and the wall clock is not believed.
std::optional<std::int64_t> TimeSince(const ClockRecord& last,
                                      const ClockReading& reading) {
  if (IsSameBoot(last, reading)) {
    return reading.since_boot_ns - last.since_boot_ns;
  }
  const std::int64_t off_ns = reading.time_ns - last.time_ns;
  if (off_ns < 0 || off_ns > kMaxTimeOff_ns) return std::nullopt;
  return off_ns;
}

}  // namespace

ClockAdvance AdvanceClock(const ClockRecord& last,
                          const ClockReading& reading) {
  const std::optional<std::int64_t> since_ns = TimeSince(last, reading);
  ClockAdvance advance{
      .clock = {.boot = reading.boot,
                .since_boot_ns = reading.since_boot_ns,
                .time_ns = reading.time_ns,
                .steady_ns = last.steady_ns + since_ns.value_or(0),
                .keep_until_ns = last.keep_until_ns},
      .step = std::nullopt};
  const std::int64_t expected_ns = last.time_ns + since_ns.value_or(0);
  if (std::abs(reading.time_ns - expected_ns) <= kClockStep_ns) return advance;
  advance.clock.keep_until_ns = advance.clock.steady_ns + kKeepAfterStep_ns;
  advance.step = fmt::format(
      "the wall clock was set from {} to {}{}: ages are counted without this "
      "step, and nothing is removed for its age for a day",
      TimeText(expected_ns),
      TimeText(reading.time_ns),
      since_ns ? "" : ", while the machine was booted");
  return advance;
}

DeviceClock::DeviceClock(Store* store,
                         std::function<ClockReading()> read,
                         const ClockRecord& last)
    : store_(store), read_(std::move(read)), last_(last) {}

absl::StatusOr<std::unique_ptr<DeviceClock>> DeviceClock::Open(
    Store* store, std::function<ClockReading()> read) {
  SELFCAL_ASSIGN_OR_RETURN(const auto stored, store->ReadClock());
  const ClockReading now = read();
  // Steady time begins as that of the wall clock.
  const ClockRecord last =
      stored.value_or(ClockRecord{.boot = now.boot,
                                  .since_boot_ns = now.since_boot_ns,
                                  .time_ns = now.time_ns,
                                  .steady_ns = now.time_ns});
  std::unique_ptr<DeviceClock> clock(
      new DeviceClock(store, std::move(read), last));
  SELFCAL_RETURN_IF_ERROR(clock->Write(AdvanceClock(last, now)));
  return clock;
}

Moment DeviceClock::Now() const {
  const std::lock_guard lock(mutex_);
  const ClockReading reading = read_();
  const std::int64_t steady_ns =
      last_.steady_ns + reading.since_boot_ns - last_.since_boot_ns;
  return {reading.time_ns, steady_ns, steady_ns < last_.keep_until_ns};
}

absl::StatusOr<std::optional<std::string>> DeviceClock::Observe() {
  const std::lock_guard lock(mutex_);
  const ClockReading reading = read_();
  const ClockAdvance advance = AdvanceClock(last_, reading);
  const bool is_due =
      advance.step ||
      advance.clock.steady_ns - last_.steady_ns >= kRecordInterval_ns;
  if (!is_due || reading.since_boot_ns < retry_at_ns_) return std::nullopt;
  const absl::Status written = Write(advance);
  if (!written.ok()) {
    retry_at_ns_ = reading.since_boot_ns + kRetry_ns;
    return written;
  }
  return advance.step;
}

absl::Status DeviceClock::Write(const ClockAdvance& advance) {
  std::optional<StoredEvent> event;
  if (advance.step) {
    event = {0,
             advance.clock.time_ns,
             "",
             EventKind::kClockStepped,
             *advance.step,
             advance.clock.steady_ns};
  }
  SELFCAL_RETURN_IF_ERROR(store_->WriteClock(advance.clock, event));
  last_ = advance.clock;
  return absl::OkStatus();
}

}  // namespace selfcal::server
