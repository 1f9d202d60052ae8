// A process that takes what others leave.
#pragma once

namespace selfcal::server {

// Call before any thread is started; what the system refuses is logged.

// The process runs only where a CPU, and reads and writes only where the disk,
// would be idle (SCHED_IDLE, I/O class idle). Without privileges there is no
// way back.
void BecomeIdle();

// The process stands behind all others (nice level 10), but gets on.
void StandBack();

}  // namespace selfcal::server
