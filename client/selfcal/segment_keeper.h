// The keeper of a queue: does what takes time, so that neither the SLAM system
// nor the sender waits for it. It assembles and encodes segments, writes those
// that do not fit into the window to the spool, reads them back when there is
// room, and removes the files of acknowledged segments.
//
// Holds at most one segment, which the queue counts. Calls no function of the
// queue that waits, except in Run.
//
// Not thread-safe: one thread works on it (keeper_thread.h). The queue must
// outlive it.
#pragma once

#include <functional>
#include <optional>

#include "client/selfcal/client.h"
#include "client/selfcal/encoded_segment.h"
#include "client/selfcal/keeper_step.h"
#include "client/selfcal/segment_queue.h"
#include "client/selfcal/spooled_segments.h"

namespace selfcal::client {

class SegmentKeeper {
 public:
  using Clock = SpooledSegments::Clock;
  // Called for segments that do not fit into a message.
  using Refuse = std::function<void(const Acknowledgement&)>;

  SegmentKeeper(const ClientOptions& options,
                SegmentQueue* queue,
                Refuse refuse);

  // Opens the spool and works until the queue finishes; then writes what is
  // not acknowledged to the spool, if there is one, as far as it fits.
  void Run() noexcept;

  // The parts of Run.
  void OpenSpool();
  // Takes one step, if there is one in this state, and returns which. If memory
  // runs out, it drops the segment that it was encoding and blocks the spool.
  KeeperStep ProcessNext(const SegmentQueue::State& state,
                         Clock::time_point now);
  // Throws std::bad_alloc; what is then in memory is lost.
  void SpoolRest();

 private:
  KeeperSituation SituationOf(const SegmentQueue::State& state) const;
  void TakeStep(KeeperStep step);
  void RemoveFiles();
  void EncodeIncoming();
  bool WriteToSpool();
  void Load();

  const ClientOptions options_;
  SegmentQueue* const queue_;
  const Refuse refuse_;
  SpooledSegments spool_;
  std::optional<EncodedSegment> encoded_;  // neither in the window nor on disk
};

}  // namespace selfcal::client
