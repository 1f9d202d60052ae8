// Sends the updates of all watches, on one thread: a watch itself has none.
// Internal to server/grpc. Any thread may call.
#pragma once

#include <condition_variable>
#include <deque>
#include <memory>
#include <mutex>
#include <set>
#include <thread>

namespace selfcal::server {

// A watch, as the sender sees it.
class SentWatch {
 public:
  virtual ~SentWatch() = default;
  // Sends the next update, or ends the call, unless something is being sent.
  // Only the thread of the sender calls.
  virtual void Send() = 0;
};

class WatchSender {
 public:
  explicit WatchSender(int limit);
  // Every watch must have been removed.
  ~WatchSender();
  WatchSender(const WatchSender&) = delete;
  WatchSender& operator=(const WatchSender&) = delete;

  // Returns false at the limit of watches.
  bool Add(const std::shared_ptr<SentWatch>& watch);
  void Remove(const std::shared_ptr<SentWatch>& watch);
  // Calls Send soon; of a watch that was removed or not added, does nothing.
  void Schedule(const std::shared_ptr<SentWatch>& watch);
  void ScheduleAll();

 private:
  void Run();

  const std::size_t limit_;
  std::mutex mutex_;  // guards what follows
  std::condition_variable changed_;
  std::set<std::shared_ptr<SentWatch>> watches_;
  std::deque<std::shared_ptr<SentWatch>> queue_;
  std::set<const SentWatch*> queued_;
  bool stopping_ = false;
  std::thread thread_;
};

}  // namespace selfcal::server
