// The threads on which calls run that may block: as many as are needed, up to a
// limit. Any thread may call.
#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>

namespace selfcal::server {

class CallThreads {
 public:
  explicit CallThreads(int limit) : limit_(limit) {}
  // Waits until no work runs.
  ~CallThreads();
  CallThreads(const CallThreads&) = delete;
  CallThreads& operator=(const CallThreads&) = delete;

  // Runs the work on a thread of its own. Returns false, and drops the work, if
  // every thread is busy and the limit is reached.
  bool Run(std::function<void()> work);
  // The same for short work, which waits for a thread instead.
  void RunSoon(std::function<void()> work);

 private:
  // Makes sure that a thread is free for one more work; false if none can be.
  bool MakeRoom();
  void Work();

  const int limit_;
  std::mutex mutex_;  // guards what follows
  std::condition_variable changed_;
  std::deque<std::function<void()>> queue_;
  int threads_ = 0;
  int idle_ = 0;
  bool stopping_ = false;
};

}  // namespace selfcal::server
