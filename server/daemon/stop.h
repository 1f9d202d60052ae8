// How the daemon is told to stop, and what happens if that takes too long.
#pragma once

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <thread>

namespace selfcal::server {

// Blocks SIGTERM and SIGINT in this thread and in those it starts, so that
// WaitForStop receives them. Call before any thread is started.
void BlockStopSignals();

// Returns the signal that arrived.
int WaitForStop();

// Ends the process with exit code 1 if it lives longer than the limit. That
// loses nothing: what was acknowledged is on disk.
class StopDeadline {
 public:
  explicit StopDeadline(std::chrono::milliseconds limit);
  ~StopDeadline();
  StopDeadline(const StopDeadline&) = delete;
  StopDeadline& operator=(const StopDeadline&) = delete;

 private:
  std::mutex mutex_;
  std::condition_variable stopped_;
  bool in_time_ = false;
  std::thread thread_;
};

}  // namespace selfcal::server
