// The uplink of a device: a thread that reports to the hub what has changed
// (server/store/outbox.h), as soon as it has, and carries out the instructions
// that come back. What cannot be sent waits.
#pragma once

#include <absl/status/status.h>

#include <chrono>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "server/api/api.h"
#include "server/store/store.h"
#include "server/uplink/hub.h"
#include "server/uplink/uplink_options.h"

namespace selfcal::server {

class Uplink {
 public:
  // All must outlive it.
  Uplink(Store* store,
         const Api* api,
         std::unique_ptr<Hub> hub,
         const UplinkOptions& options,
         std::string program_version);
  ~Uplink();
  Uplink(const Uplink&) = delete;
  Uplink& operator=(const Uplink&) = delete;

  absl::Status Start();
  // Ends a report that is under way.
  void Stop();

 private:
  void Run();
  // Waits, or not longer than until Stop: then false.
  bool Wait(std::chrono::steady_clock::duration duration);

  Store* const store_;
  const Api* const api_;
  const std::unique_ptr<Hub> hub_;
  const UplinkOptions options_;
  const std::string program_version_;
  std::mutex mutex_;  // guards what follows
  std::condition_variable stop_;
  bool stopping_ = false;
  std::thread thread_;
};

}  // namespace selfcal::server
