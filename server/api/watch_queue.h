// The updates that wait for one watcher, between a publisher that must not be
// held up and a reader that may be slow. Any thread may call.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "server/api/watch_update.h"

namespace selfcal::server {

class WatchQueue {
 public:
  // Returns an update when it is about to be sent; null: there is nothing to
  // send.
  using Encode =
      std::function<absl::StatusOr<std::shared_ptr<const WatchUpdate>>()>;

  // `arrived` is called without locks whenever there is something to take: an
  // update or the end. It must return at once and must not take.
  explicit WatchQueue(std::function<void()> arrived = nullptr);

  // A check that each update has to pass when it is about to be sent; an error
  // ends the watch. For a reader whose rights may change.
  void SetGate(std::function<absl::Status()> gate);
  // Adds an update. It replaces the waiting update of the same key, so that a
  // slow reader gets the newest. Beyond kCapacity waiting updates the oldest is
  // dropped, unless there is a summary.
  void Put(const std::string& key, Encode update);
  // Sets an update that replaces all waiting ones when there are too many.
  void SetSummary(Encode summary);
  // Ends the watch after the updates that wait; later updates are ignored.
  void Close(absl::Status status = absl::OkStatus());

  struct Taken {
    Encode update;  // null: none is waiting
    bool ended = false;
    absl::Status status;  // of a watch that has ended
  };
  // Returns the oldest update or, if there is none, whether the watch has
  // ended.
  Taken Take();
  // The same, but waits for at most `timeout` until there is something to take.
  Taken Take(std::chrono::milliseconds timeout);

  static constexpr std::size_t kCapacity = 1000;

 private:
  struct Update {
    std::string key;
    Encode encode;
  };

  Taken TakeLocked();

  const std::function<void()> notify_;
  std::mutex mutex_;  // guards what follows
  std::condition_variable arrived_;
  std::deque<Update> updates_;
  std::function<absl::Status()> gate_;
  Encode summary_;
  bool closed_ = false;
  absl::Status status_;
};

}  // namespace selfcal::server
