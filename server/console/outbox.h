// Between who tells and one reader of a stream that may be slow: lines that
// wait, each once, and no more than so many. Any thread may call.
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
  // `overflow` takes the place of all lines when there are too many.
  explicit Outbox(std::string overflow) : overflow_(std::move(overflow)) {}

  void Put(std::string line);
  // What waits is still taken; after that the stream has ended.
  void Close();
  // What waits, together; empty after the timeout, nothing at the end.
  std::optional<std::string> Take(std::chrono::milliseconds timeout);

 private:
  const std::string overflow_;
  std::mutex mutex_;  // guards the rest
  std::condition_variable arrived_;
  std::deque<std::string> lines_;
  bool closed_ = false;
};

}  // namespace selfcal::server
