// A thread that takes what others leave.
#pragma once

namespace selfcal::server {

// The calling thread runs only where a CPU, and reads and writes only where the
// disk, would be idle (SCHED_IDLE, I/O class idle). Without privileges there is
// no way back: for threads that end with their work. What the system refuses is
// logged.
void BecomeIdle();

// The calling thread stands behind all others (nice level 10), but gets on.
void StandBack();

}  // namespace selfcal::server
