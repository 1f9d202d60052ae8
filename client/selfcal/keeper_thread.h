// The thread of a keeper, from construction to destruction. Its priority is
// lower than that of the SLAM system's thread.
#pragma once

#include <thread>

#include "client/selfcal/client.h"
#include "client/selfcal/segment_keeper.h"
#include "client/selfcal/segment_queue.h"

namespace selfcal::client {

class KeeperThread {
 public:
  // Throws std::system_error if no thread can be started, and std::bad_alloc.
  KeeperThread(const ClientOptions& options,
               SegmentQueue* queue,
               SegmentKeeper::Refuse refuse);
  // Finishes the queue, and waits until unacknowledged segments are in the
  // spool. Before, stop the queue and wait until the sender has ended.
  ~KeeperThread();
  KeeperThread(const KeeperThread&) = delete;
  KeeperThread& operator=(const KeeperThread&) = delete;

 private:
  SegmentQueue* const queue_;
  SegmentKeeper keeper_;
  std::thread thread_;  // last: it uses the keeper
};

}  // namespace selfcal::client
