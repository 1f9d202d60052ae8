#include "server/daemon/stop.h"

#include <signal.h>
#include <spdlog/spdlog.h>

#include <cstdlib>

namespace selfcal::server {
namespace {

sigset_t StopSignals() {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGTERM);
  sigaddset(&signals, SIGINT);
  return signals;
}

}  // namespace

void BlockStopSignals() {
  const sigset_t signals = StopSignals();
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
}

int WaitForStop() {
  const sigset_t signals = StopSignals();
  int signal = 0;
  sigwait(&signals, &signal);
  return signal;
}

StopDeadline::StopDeadline(std::chrono::milliseconds limit)
    : thread_([this, limit] {
        std::unique_lock lock(mutex_);
        if (stopped_.wait_for(lock, limit, [this] { return in_time_; })) return;
        spdlog::error("did not stop within {} ms; ending at once",
                      limit.count());
        std::_Exit(EXIT_FAILURE);
      }) {}

StopDeadline::~StopDeadline() {
  {
    const std::lock_guard lock(mutex_);
    in_time_ = true;
  }
  stopped_.notify_one();
  thread_.join();
}

}  // namespace selfcal::server
