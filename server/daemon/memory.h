// The heap of a daemon that runs for years.
#pragma once

namespace selfcal::server {

// Before the first thread. Segments and what a run computes with go from thread
// to thread: with an arena for each thread the heap grows to several times of
// what is in use, and what is large stays in it.
void KeepHeapSmall();

// Gives back what is free in the midst of the heap, now and then: at most once
// in 5 s, for it holds up whoever allocates for some ms.
void TrimHeap();

}  // namespace selfcal::server
