// A thread that repeats a pass: after a pause, or sooner once it is woken. Any
// thread may call; the pass may call Wake alone.
#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <thread>

namespace selfcal::server {

class PeriodicThread {
 public:
  // Returns the pause before the next pass.
  using Pass = std::function<std::chrono::milliseconds()>;

  // `min_pause` comes before each pause, and is not shortened by Wake.
  explicit PeriodicThread(std::chrono::milliseconds min_pause)
      : min_pause_(min_pause) {}
  ~PeriodicThread() { Stop(); }

  // Must not be running.
  void Start(Pass pass);
  // Returns when the present pass has ended.
  void Stop();
  // The next pass begins without a pause.
  void Wake();

 private:
  void Run(const Pass& pass);

  const std::chrono::milliseconds min_pause_;
  std::mutex mutex_;  // guards what follows; not held during a pass
  std::condition_variable changed_;
  bool running_ = false;
  bool woken_ = false;
  std::thread thread_;
};

}  // namespace selfcal::server
