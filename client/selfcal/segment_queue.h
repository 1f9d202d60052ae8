// The queue of a stream: it accepts segments from the SLAM system, encodes them
// as messages, spools them to disk while the daemon is unreachable, hands them
// to the sender, and removes them when they are acknowledged.
//
//   Push -> incoming -> [spool on disk] -> head -> Next ... Acknowledge
//
// `head` has the segments that the sender works on, oldest first; the first
// in_flight of them have been sent on this connection. A thread of the queue,
// the keeper, does everything that takes time: it assembles and encodes
// segments, writes those that do not fit into the head to the spool, and reads
// them back when there is room.
//
// Push, the sender's functions and the statistics may be called from any
// thread; they wait only for each other.
#pragma once

#include <absl/status/status.h>

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>
#include <variant>
#include <vector>

#include "client/selfcal/client.h"
#include "client/selfcal/closed_segment.h"
#include "client/selfcal/spool.h"
#include "selfcal/v1/segment.pb.h"

namespace selfcal::client {

class SegmentQueue {
 public:
  using Request = v1::StreamSegmentsRequest;
  using Material = std::variant<MotionSegment, ClosedSegment>;
  // The keeper calls it for segments that do not fit into a message.
  using Refuse = std::function<void(const Acknowledgement&)>;

  // Throws std::system_error if no thread can be started, and std::bad_alloc.
  SegmentQueue(const ClientOptions& options, Refuse refuse);
  // Writes unacknowledged segments to the spool, if there is one, as far as
  // they fit. Before, call Stop and wait until the sender has ended.
  ~SegmentQueue();
  SegmentQueue(const SegmentQueue&) = delete;
  SegmentQueue& operator=(const SegmentQueue&) = delete;

  // Returns false and counts the segment as dropped if the queue is full,
  // memory runs out, or sending has ended.
  bool Push(Material segment) noexcept;
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
  std::shared_ptr<const Request> Next();
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

 private:
  struct Entry {
    std::uint64_t number = 0;  // defines the order and the name in the spool
    SegmentKey key;
    std::shared_ptr<const Request> request;
    bool on_disk = false;
    bool was_sent = false;
  };

  // Functions of the keeper's thread (segment_keeper.cc).
  using Lock = std::unique_lock<std::mutex>;
  void Keep();
  void OpenSpool();
  bool HasPending() const;
  bool CanLoad() const;
  bool CanAdmit() const;
  bool HeadIsNext() const;
  void ProcessPending(Lock& lock);
  void RemoveFiles(Lock& lock);
  void Load(Lock& lock);
  void Admit(Lock& lock);
  std::optional<Entry> Prepare(Material material, Lock& lock);
  void Write(Lock& lock);
  void NoteSpool();
  void SpoolRest(Lock& lock);

  std::size_t Held() const;
  void Count(Acknowledgement::Verdict verdict);

  const ClientOptions options_;
  const Refuse refuse_;
  const std::size_t max_held_;
  const std::size_t max_head_;

  // Used by the keeper only.
  std::unique_ptr<Spool> spool_;
  std::uint64_t next_number_ = 1;
  std::uint64_t loaded_ = 0;      // files up to this number are in the head
  std::optional<Entry> pending_;  // admitted, waits for room

  mutable std::mutex mutex_;         // guards all below
  std::condition_variable work_;     // only the keeper waits for it, so that
  std::condition_variable changed_;  // Push wakes no other thread
  std::deque<Material> incoming_;
  bool admitting_ = false;  // the keeper holds a segment that is nowhere else
  std::deque<Entry> head_;
  std::size_t in_flight_ = 0;
  std::vector<std::uint64_t> finished_files_;
  bool spool_ready_ = false;    // opened, or there is none
  bool spool_blocked_ = false;  // full or failing; retried after kSpoolRetry
  absl::Status spool_status_;
  int callbacks_due_ = 0;
  StreamStatistics statistics_;
  absl::Status end_;  // if not OK, nothing is sent any more
  bool open_ = false;
  bool stop_ = false;
  bool finish_ = false;

  std::thread keeper_;  // last: it uses all of the above
};

}  // namespace selfcal::client
