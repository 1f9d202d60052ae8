// Priorities of a process below that of others.
#pragma once

namespace selfcal::server {

// Call these before any thread is started. A refusal by the system is logged.

// The process uses only CPU time and disk bandwidth that would otherwise be
// idle (SCHED_IDLE, I/O class idle). Without privileges this cannot be
// reverted.
void BecomeIdle();

// The process has a lower priority than others (nice level 10), but continues
// to make progress.
void LowerPriority();

}  // namespace selfcal::server
