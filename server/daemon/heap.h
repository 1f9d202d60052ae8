// Settings of the heap for a daemon that runs for years.
#pragma once

namespace selfcal::server {

// Limits the growth of the heap. Call it before the first thread is started.
// Segments and the data of runs move between threads: with an arena for each
// thread, the heap would grow to several times the memory in use, and would
// keep large blocks.
void KeepHeapSmall();

// Returns free memory within the heap to the system, at most once in 5 s,
// because it blocks allocations for some ms.
void TrimHeap();

}  // namespace selfcal::server
