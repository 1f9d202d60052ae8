// The queue of a stream: it passes segments from the SLAM system to the sender,
// and forgets them when they are acknowledged.
//
//   Push -> incoming -> keeper -> window -> Next ... Acknowledge
//                        |   ^
//                        v   |
//                        spool
//
// It is a monitor: every function may be called from any thread, and holds the
// mutex only to move or count segments. None but those whose comment says so
// waits for anything else; what takes time, encoding and the disk, is done by
// the keeper (segment_keeper.h) without the mutex.
//
// It holds at most max_queue segments: those that wait for the keeper, the one
// that the keeper encodes or writes, the one that it reads, and those in the
// window. While segments are on disk only, Push leaves room for one of them, so
// that the sender never runs out of work. While the keeper works on a segment,
// it counts as unacknowledged, so that WaitUntilDone misses none.
#pragma once

#include <absl/status/status.h>

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "client/selfcal/client.h"
#include "client/selfcal/encoded_segment.h"
#include "client/selfcal/incoming_segments.h"
#include "client/selfcal/send_window.h"
#include "client/selfcal/spooled_segments.h"
#include "selfcal/v1/segment.pb.h"

namespace selfcal::client {

class SegmentQueue {
 public:
  using Clock = std::chrono::steady_clock;

  // What the keeper decides by.
  struct State {
    std::size_t incoming = 0;        // segments that wait for the keeper
    std::size_t in_window = 0;       // segments
    std::size_t in_memory = 0;       // segments: all that the queue holds
    std::size_t finished_files = 0;  // of the spool
    bool finishing = false;
    friend bool operator==(const State&, const State&) = default;
  };

  explicit SegmentQueue(const ClientOptions& options);
  SegmentQueue(const SegmentQueue&) = delete;
  SegmentQueue& operator=(const SegmentQueue&) = delete;

  // Returns false and counts the segment as dropped if the queue is full,
  // memory runs out, or sending has ended.
  bool Push(UnencodedSegment segment) noexcept;
  // Waits until everything is acknowledged or sending has ended; false after
  // the timeout.
  bool WaitUntilDone(std::chrono::milliseconds timeout);
  std::size_t unacknowledged() const;
  StreamStatistics statistics() const;
  absl::Status spool_status() const;

  // The functions from here on are for the sender.
  // Waits until there is something to send; false if stopped.
  bool WaitForWork();
  // Starts a connection, on which everything is sent (again).
  void Open();
  // Returns the next request. Waits until there is one and the number of
  // unacknowledged segments allows it; null after Close.
  std::shared_ptr<const v1::StreamSegmentsRequest> Next();
  void Close();
  // Waits for this time; false if stopped meanwhile.
  bool Pause(std::chrono::milliseconds time);
  // Removes the acknowledged segment, counts its verdict, and counts one
  // callback as due. Returns false if no such segment was sent.
  bool Acknowledge(const Acknowledgement& ack);
  void CallbackReturned(bool failed);
  void NoteConnection();
  void End(const absl::Status& why);
  absl::Status end() const;
  void Stop();
  bool stopped() const;

  // The functions from here on are for the keeper.
  State state() const;
  // Waits until the state differs from `seen`, at most until then.
  State WaitForChange(const State& seen,
                      std::optional<Clock::time_point> until);
  // Hands the oldest incoming segment to the keeper, which must end with it by
  // one of the next four functions before it takes another.
  std::optional<UnencodedSegment> TakeIncoming();
  // Counts what the assembly of the incoming segment did.
  void NoteAssembled(const AssemblyStatistics& counts);
  // Reserves room for a segment that is read from disk, until Append or
  // ReportSpool. Returns false if there is none.
  bool ReserveRoom();
  // Appends the segment to the window: the one that the keeper was handed, or,
  // if it is on disk, the one for which it has reserved room. If it throws
  // std::bad_alloc, the segment is unchanged.
  void Append(EncodedSegment&& segment);
  // The segment is on disk, as the report states.
  void NoteSpooled(const SpoolReport& report);
  // The segment does not fit into a message: counts it as rejected, and one
  // callback as due.
  void NoteRefused();
  // Memory ran out for the segment: counts it as dropped.
  void NoteDropped();
  // Returns the numbers of acknowledged segments that have a file, once.
  std::vector<std::uint64_t> TakeFinishedFiles();
  // Publishes the state of the spool, and releases room that is reserved.
  void ReportSpool(const SpoolReport& report);
  // Ends the keeper's work, and sending with it.
  void Finish();
  // Takes the oldest segment out of the window, after Finish.
  std::optional<EncodedSegment> TakeOldest();

 private:
  std::size_t InMemory() const { return incoming_.size() + window_.size(); }
  std::size_t KeptFromPush() const;
  State StateLocked() const;

  mutable std::mutex mutex_;         // guards all below
  std::condition_variable work_;     // only the keeper waits for it, so that
  std::condition_variable changed_;  // Push wakes no other thread
  IncomingSegments incoming_;
  SendWindow window_;
  bool reserved_ = false;  // room for one more in the window
  std::vector<std::uint64_t> finished_files_;
  SpoolReport spool_;
  int callbacks_due_ = 0;
  StreamStatistics statistics_;  // without the spool's
  absl::Status end_;             // if not OK, nothing is sent any more
  bool stop_ = false;
  bool finish_ = false;
};

}  // namespace selfcal::client
