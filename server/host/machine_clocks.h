// The clocks of the machine.
#pragma once

#include <functional>

#include "server/domain/device_clock.h"

namespace selfcal::server {

// Returns a function that reads them. Any thread may call it.
std::function<ClockReading()> MachineClocks();

}  // namespace selfcal::server
