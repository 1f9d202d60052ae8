#include "server/host/machine_clocks.h"

#include <time.h>

#include <cstdint>
#include <fstream>
#include <string>

#include "server/domain/clock.h"

namespace selfcal::server {
namespace {

// Includes the time that the machine slept.
std::int64_t SinceBootNs() {
  timespec time{};
  clock_gettime(CLOCK_BOOTTIME, &time);
  return std::int64_t{time.tv_sec} * 1'000'000'000 + time.tv_nsec;
}

}  // namespace

std::function<ClockReading()> MachineClocks() {
  std::ifstream stream("/proc/sys/kernel/random/boot_id");
  std::string boot;
  stream >> boot;
  return [boot] {
    return ClockReading{
        .boot = boot, .since_boot_ns = SinceBootNs(), .time_ns = NowNs()};
  };
}

}  // namespace selfcal::server
