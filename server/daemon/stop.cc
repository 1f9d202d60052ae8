#include "server/daemon/stop.h"

#include <signal.h>
#include <spdlog/spdlog.h>
#include <time.h>
#include <unistd.h>

#include <cstdlib>

namespace selfcal::server {
namespace {

sigset_t Signals() {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGTERM);
  sigaddset(&signals, SIGINT);
  sigaddset(&signals, SIGHUP);
  sigaddset(&signals, kRestart);
  return signals;
}

}  // namespace

void BlockSignals() {
  const sigset_t signals = Signals();
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
}

std::optional<int> WaitForSignal(std::chrono::milliseconds limit) {
  const sigset_t signals = Signals();
  const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(limit);
  const std::chrono::nanoseconds rest = limit - seconds;
  const timespec timeout{seconds.count(), rest.count()};
  const int signal = sigtimedwait(&signals, nullptr, &timeout);
  return signal < 0 ? std::nullopt : std::optional(signal);
}

void RequestRestart() { kill(getpid(), kRestart); }

StopDeadline::StopDeadline(std::chrono::milliseconds limit)
    : thread_([this, limit] {
        std::unique_lock lock(mutex_);
        if (stopped_.wait_for(lock, limit, [this] { return in_time_; })) return;
        spdlog::error("the daemon did not stop within {} ms and is terminated",
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
