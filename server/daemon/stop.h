// What the daemon is told by signals: to stop, to look at its settings again;
// and what happens if a stop takes too long.
#pragma once

#include <signal.h>

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <optional>
#include <thread>

namespace selfcal::server {

// What the daemon sends to itself when it is to stop and start again: apart
// from SIGTERM, so that a stop that comes at the same time is not lost.
inline constexpr int kStartAnew = SIGUSR1;
void AskToStartAnew();

// Blocks these signals in this thread and in those it starts, so that
// WaitForSignal receives them. Call before any thread is started.
void BlockSignals();

// The signal that arrived; nothing if none does within the limit.
std::optional<int> WaitForSignal(std::chrono::milliseconds limit);

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
