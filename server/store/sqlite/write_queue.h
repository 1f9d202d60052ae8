// Writes that wait for the thread that carries them out, in the order of their
// arrival. Any thread may call; one thread takes.
#pragma once

#include <absl/status/status.h>

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <mutex>
#include <vector>

#include "server/store/driver/driver.h"

namespace selfcal::server {

struct QueuedWrite {
  Database::Work work;
  Database::Done done;
  absl::Status status = absl::OkStatus();  // with which `done` is called
};

class WriteQueue {
 public:
  void Push(QueuedWrite write);
  // Does nothing if a write is queued.
  void PushIfEmpty(QueuedWrite write);
  // Makes Take return none once it has returned all that is queued.
  void Stop();

  // Waits for a write, and takes the oldest ones, at most `max`.
  std::vector<QueuedWrite> Take(std::size_t max);

 private:
  std::mutex mutex_;  // guards what follows
  std::condition_variable arrived_;
  std::deque<QueuedWrite> writes_;
  bool stopped_ = false;
};

}  // namespace selfcal::server
