#include "client/selfcal/segment_queue.h"

#include <algorithm>
#include <utility>

namespace selfcal::client {
namespace {

std::size_t AtLeastOne(int count) {
  return static_cast<std::size_t>(std::max(count, 1));
}

// With a spool, half of the queue is for segments that wait for the disk.
std::size_t HeadRoom(const ClientOptions& options) {
  const std::size_t all = AtLeastOne(options.max_queue);
  if (options.spool_dir.empty()) return all;
  return std::max<std::size_t>(all / 2, 1);
}

}  // namespace

SegmentQueue::SegmentQueue(const ClientOptions& options, Refuse refuse)
    : options_(options),
      refuse_(std::move(refuse)),
      max_held_(AtLeastOne(options.max_queue)),
      max_head_(HeadRoom(options)) {
  keeper_ = std::thread([this] { Keep(); });
}

SegmentQueue::~SegmentQueue() {
  {
    std::lock_guard lock(mutex_);
    stop_ = true;
    finish_ = true;
  }
  work_.notify_one();
  keeper_.join();
}

bool SegmentQueue::Push(Material segment) noexcept {
  {
    std::lock_guard lock(mutex_);
    bool taken = false;
    if (end_.ok() && !stop_ && Held() < max_held_) {
      try {
        incoming_.push_back(std::move(segment));
        taken = true;
      } catch (const std::exception&) {  // no memory
      }
    }
    ++(taken ? statistics_.queued : statistics_.dropped);
    if (!taken) return false;
  }
  work_.notify_one();
  return true;
}

bool SegmentQueue::WaitUntilDone(std::chrono::milliseconds timeout) {
  Lock lock(mutex_);
  return changed_.wait_for(lock, timeout, [this] {
    const bool empty = Held() == 0 && statistics_.spool_segments == 0;
    return !end_.ok() || (spool_ready_ && empty && callbacks_due_ == 0);
  });
}

std::size_t SegmentQueue::unacknowledged() const {
  std::lock_guard lock(mutex_);
  const auto loaded =
      std::count_if(head_.begin(), head_.end(), [](const Entry& entry) {
        return entry.on_disk;
      });
  return Held() - static_cast<std::size_t>(loaded) + statistics_.spool_segments;
}

StreamStatistics SegmentQueue::statistics() const {
  std::lock_guard lock(mutex_);
  return statistics_;
}

absl::Status SegmentQueue::spool_status() const {
  std::lock_guard lock(mutex_);
  return spool_status_;
}

bool SegmentQueue::WaitForWork() {
  Lock lock(mutex_);
  changed_.wait(lock, [this] { return stop_ || !head_.empty(); });
  return !stop_;
}

void SegmentQueue::Open() {
  std::lock_guard lock(mutex_);
  in_flight_ = 0;
  open_ = true;
}

std::shared_ptr<const SegmentQueue::Request> SegmentQueue::Next() {
  Lock lock(mutex_);
  const std::size_t window = AtLeastOne(options_.max_unacknowledged);
  changed_.wait(lock, [&] {
    return stop_ || !open_ || in_flight_ < std::min(window, head_.size());
  });
  if (stop_ || !open_) return nullptr;
  Entry& entry = head_[in_flight_];
  ++in_flight_;  // before it is sent, because the acknowledgement may be quick
  if (entry.was_sent) ++statistics_.resent;
  entry.was_sent = true;
  return entry.request;
}

void SegmentQueue::Close() {
  {
    std::lock_guard lock(mutex_);
    open_ = false;
  }
  changed_.notify_all();
}

bool SegmentQueue::Pause(std::chrono::milliseconds time) {
  Lock lock(mutex_);
  changed_.wait_for(lock, time, [this] { return stop_; });
  return !stop_;
}

bool SegmentQueue::Acknowledge(const Acknowledgement& ack) {
  {
    std::lock_guard lock(mutex_);
    const auto end = head_.begin() + static_cast<std::ptrdiff_t>(in_flight_);
    const auto entry =
        std::find_if(head_.begin(), end, [&](const Entry& candidate) {
          return candidate.key == ack.key;
        });
    if (entry == end) return false;
    if (entry->on_disk) finished_files_.push_back(entry->number);
    head_.erase(entry);
    --in_flight_;
    Count(ack.verdict);
    ++callbacks_due_;
  }
  work_.notify_one();
  changed_.notify_all();
  return true;
}

void SegmentQueue::CallbackReturned(bool failed) {
  {
    std::lock_guard lock(mutex_);
    --callbacks_due_;
    if (failed) ++statistics_.callback_failures;
  }
  changed_.notify_all();
}

void SegmentQueue::NoteConnection() {
  std::lock_guard lock(mutex_);
  ++statistics_.connections;
}

void SegmentQueue::End(const absl::Status& why) {
  {
    std::lock_guard lock(mutex_);
    end_ = why;
  }
  changed_.notify_all();
}

absl::Status SegmentQueue::end() const {
  std::lock_guard lock(mutex_);
  return end_;
}

void SegmentQueue::Stop() {
  {
    std::lock_guard lock(mutex_);
    stop_ = true;
  }
  changed_.notify_all();
}

bool SegmentQueue::stopped() const {
  std::lock_guard lock(mutex_);
  return stop_;
}

// Number of segments in memory.
std::size_t SegmentQueue::Held() const {
  return incoming_.size() + (admitting_ ? 1 : 0) + head_.size();
}

void SegmentQueue::Count(Acknowledgement::Verdict verdict) {
  switch (verdict) {
    case Acknowledgement::Verdict::kStored:
      ++statistics_.stored;
      break;
    case Acknowledgement::Verdict::kDuplicate:
      ++statistics_.duplicates;
      break;
    case Acknowledgement::Verdict::kRejected:
      ++statistics_.rejected;
      break;
  }
}

}  // namespace selfcal::client
