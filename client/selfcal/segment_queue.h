// The segments of a stream on their way: taken from the SLAM system, turned
// into messages, kept on disk while the daemon is away, sent, acknowledged.
//
//   Push -> incoming -> [spool on disk] -> head -> Next ... Take
//
// `head` is what the sender works on, oldest first: in_flight of them have been
// sent on this connection. A thread of the queue's own, the keeper, does all
// that takes time: it assembles and encodes segments, writes what the head has
// no room for to the spool, and reads it back when it has.
//
// Push, the sender's functions and the statistics may be called from any
// thread; they only ever wait for each other.
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
  // Called by the keeper for segments that no message can carry.
  using Refuse = std::function<void(const Acknowledgement&)>;

  // Throws std::system_error if there can be no thread, std::bad_alloc.
  SegmentQueue(const ClientOptions& options, Refuse refuse);
  // Call Stop first, and let the sender end. Writes to the spool, if there is
  // one and while there is room, what was not acknowledged.
  ~SegmentQueue();
  SegmentQueue(const SegmentQueue&) = delete;
  SegmentQueue& operator=(const SegmentQueue&) = delete;

  // False, and counted as dropped, if there is no room, no memory, or no
  // further sending.
  bool Push(Material segment) noexcept;
  // Until everything is acknowledged, or sending has ended: true.
  bool WaitUntilDone(std::chrono::milliseconds timeout);
  std::size_t unacknowledged() const;
  StreamStatistics statistics() const;
  absl::Status spool_status() const;

  // For the sender: until there is something to send. False: stopped.
  bool WaitForWork();
  // A connection begins: everything is to be sent (again).
  void Open();
  // Waits until there is one and the window has room; null once closed.
  std::shared_ptr<const Request> Next();
  void Close();
  // Waits; false if stopped meanwhile.
  bool Pause(std::chrono::milliseconds time);
  // A segment that was sent is acknowledged; false if it is none. Counts its
  // verdict, and one callback as due.
  bool Take(const Acknowledgement& ack);
  void CallbackReturned(bool failed);
  void NoteConnection();
  void End(const absl::Status& why);
  absl::Status end() const;
  void Stop();
  bool stopped() const;

 private:
  struct Entry {
    std::uint64_t number = 0;  // order, and name in the spool
    SegmentKey key;
    std::shared_ptr<const Request> request;
    bool on_disk = false;
    bool was_sent = false;
  };

  // Of the keeper's thread (segment_keeper.cc).
  using Lock = std::unique_lock<std::mutex>;
  void Keep();
  void OpenSpool();
  bool HasChore() const;
  bool CanLoad() const;
  bool CanTakeIn() const;
  bool HeadIsNext() const;
  void DoChore(Lock& lock);
  void RemoveFiles(Lock& lock);
  void Load(Lock& lock);
  void SetAside(std::uint64_t number, const absl::Status& why);
  void TakeIn(Lock& lock);
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

  // The keeper's alone.
  std::unique_ptr<Spool> spool_;
  std::uint64_t next_number_ = 1;
  std::uint64_t loaded_ = 0;      // files up to this number are in the head
  std::optional<Entry> pending_;  // taken in, waits for a place

  mutable std::mutex mutex_;         // guards all below
  std::condition_variable chores_;   // the keeper waits for it alone, so
  std::condition_variable changed_;  // that Push wakes nobody else
  std::deque<Material> incoming_;
  bool taking_in_ = false;  // the keeper holds one that is nowhere else
  std::deque<Entry> head_;
  std::size_t in_flight_ = 0;
  std::vector<std::uint64_t> finished_files_;
  bool spool_ready_ = false;    // opened, or there is none
  bool spool_blocked_ = false;  // full or failing: tried again in a while
  absl::Status spool_status_;
  int callbacks_due_ = 0;
  StreamStatistics statistics_;
  absl::Status end_;  // not OK: nothing is sent any more
  bool open_ = false;
  bool stop_ = false;
  bool finish_ = false;

  std::thread keeper_;  // last: it uses all of the above
};

}  // namespace selfcal::client
