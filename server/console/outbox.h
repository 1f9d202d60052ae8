// A bounded queue of lines between the publishers of a stream and its reader,
// which may be slow. A line that is queued is not queued twice. Any thread may
// call.
#pragma once

#include <chrono>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <optional>
#include <string>

namespace selfcal::server {

class Outbox {
 public:
  // When there are too many lines, `overflow` replaces all of them.
  explicit Outbox(std::string overflow) : overflow_(std::move(overflow)) {}

  void Put(std::string line);
  // Ends the stream once the queued lines are taken.
  void Close();
  // Takes all queued lines; empty after the timeout, nullopt at the end.
  std::optional<std::string> Take(std::chrono::milliseconds timeout);

 private:
  const std::string overflow_;
  std::mutex mutex_;  // guards the rest
  std::condition_variable arrived_;
  std::deque<std::string> lines_;
  bool closed_ = false;
};

}  // namespace selfcal::server
