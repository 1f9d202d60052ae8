// Signals to the daemon: stop, restart, and reread the settings; and the
// deadline of a stop.
#pragma once

#include <signal.h>

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <optional>
#include <thread>

namespace selfcal::server {

// The signal that the daemon sends to itself in order to restart: different
// from SIGTERM, so that a stop at the same time is not lost.
inline constexpr int kRestart = SIGUSR1;
void RequestRestart();

// Blocks these signals in this thread and in those it starts, so that
// WaitForSignal receives them. Call before any thread is started.
void BlockSignals();

// Waits for a signal and returns it; nullopt if none arrives within the limit.
std::optional<int> WaitForSignal(std::chrono::milliseconds limit);

// Ends the process with exit code 1 if this object lives longer than the limit.
// Nothing is lost then: everything that was acknowledged is on disk.
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
