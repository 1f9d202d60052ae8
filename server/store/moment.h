// The time of what is written, by two clocks.
#pragma once

#include <cstdint>

namespace selfcal::server {

struct Moment {
  // The wall clock never jumps.
  // NOLINTNEXTLINE(google-explicit-constructor)
  Moment(std::int64_t ns) : time_ns(ns), steady_ns(ns) {}
  Moment(std::int64_t time_ns, std::int64_t steady_ns, bool keeps_aged)
      : time_ns(time_ns), steady_ns(steady_ns), keeps_aged(keeps_aged) {}

  // Wall clock, since the Unix epoch: this is shown.
  std::int64_t time_ns;
  // Steady time of the device (server/domain/device_clock.h): ages are
  // differences of it.
  std::int64_t steady_ns;
  // Nothing is removed for its age at present.
  bool keeps_aged = false;
};

}  // namespace selfcal::server
