#include "client/selfcal/segment_queue.h"

#include <algorithm>
#include <utility>

#include "client/selfcal/queue_limits.h"

namespace selfcal::client {
namespace {

void Count(Acknowledgement::Verdict verdict, StreamStatistics* statistics) {
  switch (verdict) {
    case Acknowledgement::Verdict::kStored:
      ++statistics->stored;
      break;
    case Acknowledgement::Verdict::kDuplicate:
      ++statistics->duplicates;
      break;
    case Acknowledgement::Verdict::kRejected:
      ++statistics->rejected;
      break;
  }
}

}  // namespace

SegmentQueue::SegmentQueue(const ClientOptions& options)
    : incoming_(MaxInMemory(options)), window_(MaxInFlight(options)) {
  spool_.has_unloaded = !options.spool_dir.empty();  // until it is opened
}

bool SegmentQueue::Push(UnencodedSegment segment) noexcept {
  {
    std::lock_guard lock(mutex_);
    const bool accepted = end_.ok() && !stop_ &&
                          incoming_.Push(std::move(segment), KeptFromPush());
    ++(accepted ? statistics_.queued : statistics_.dropped);
    if (!accepted) return false;
  }
  work_.notify_one();
  return true;
}

bool SegmentQueue::WaitUntilDone(std::chrono::milliseconds timeout) {
  std::unique_lock lock(mutex_);
  return changed_.wait_for(lock, timeout, [this] {
    const bool empty = InMemory() == 0 && spool_.segments == 0;
    return !end_.ok() || (spool_.opened && empty && callbacks_due_ == 0);
  });
}

std::size_t SegmentQueue::unacknowledged() const {
  std::lock_guard lock(mutex_);
  return InMemory() - window_.on_disk() + spool_.segments;
}

StreamStatistics SegmentQueue::statistics() const {
  std::lock_guard lock(mutex_);
  StreamStatistics all = statistics_;
  all.resent = window_.resent();
  all.spooled = spool_.spooled;
  all.spool_recovered = spool_.recovered;
  all.spool_damaged = spool_.damaged;
  all.spool_failures = spool_.failures;
  all.spool_segments = spool_.segments;
  all.spool_bytes = spool_.bytes;
  return all;
}

absl::Status SegmentQueue::spool_status() const {
  std::lock_guard lock(mutex_);
  return spool_.status;
}

bool SegmentQueue::WaitForWork() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return stop_ || window_.size() > 0; });
  return !stop_;
}

void SegmentQueue::Open() {
  std::lock_guard lock(mutex_);
  window_.Open();
}

std::shared_ptr<const v1::StreamSegmentsRequest> SegmentQueue::Next() {
  std::unique_lock lock(mutex_);
  changed_.wait(
      lock, [this] { return stop_ || !window_.open() || window_.CanSend(); });
  if (stop_ || !window_.open()) return nullptr;
  return window_.Next();
}

void SegmentQueue::Close() {
  {
    std::lock_guard lock(mutex_);
    window_.Close();
  }
  changed_.notify_all();
}

bool SegmentQueue::Pause(std::chrono::milliseconds time) {
  std::unique_lock lock(mutex_);
  changed_.wait_for(lock, time, [this] { return stop_; });
  return !stop_;
}

bool SegmentQueue::Acknowledge(const Acknowledgement& ack) {
  std::optional<EncodedSegment> segment;  // freed without the mutex
  {
    std::lock_guard lock(mutex_);
    // If this throws, nothing has changed.
    finished_files_.reserve(finished_files_.size() + 1);
    segment = window_.Acknowledge(ack.key);
    if (!segment.has_value()) return false;
    if (segment->on_disk) finished_files_.push_back(segment->number);
    Count(ack.verdict, &statistics_);
    statistics_.observations_dropped += ack.observations_dropped;
    statistics_.readings_dropped += ack.readings_dropped;
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

SegmentQueue::State SegmentQueue::state() const {
  std::lock_guard lock(mutex_);
  return StateLocked();
}

SegmentQueue::State SegmentQueue::WaitForChange(
    const State& seen, std::optional<Clock::time_point> until) {
  std::unique_lock lock(mutex_);
  const auto differs = [&] { return StateLocked() != seen; };
  if (until.has_value()) {
    work_.wait_until(lock, *until, differs);
  } else {
    work_.wait(lock, differs);
  }
  return StateLocked();
}

std::optional<UnencodedSegment> SegmentQueue::TakeIncoming() {
  std::lock_guard lock(mutex_);
  return incoming_.Take();
}

void SegmentQueue::NoteAssembled(const AssemblyStatistics& counts) {
  std::lock_guard lock(mutex_);
  statistics_.tracks_triangulated += counts.tracks_triangulated;
  statistics_.tracks_dropped += counts.tracks_dropped;
}

bool SegmentQueue::ReserveRoom() {
  std::lock_guard lock(mutex_);
  reserved_ = incoming_.HasRoom(window_.size());
  return reserved_;
}

void SegmentQueue::Append(EncodedSegment&& segment) {
  const bool was_on_disk = segment.on_disk;
  {
    std::lock_guard lock(mutex_);
    window_.Append(std::move(segment));
    if (was_on_disk) {
      reserved_ = false;
    } else {
      incoming_.Release();
    }
  }
  changed_.notify_all();
}

void SegmentQueue::NoteSpooled(const SpoolReport& report) {
  {
    std::lock_guard lock(mutex_);
    spool_ = report;
    incoming_.Release();
  }
  changed_.notify_all();
}

void SegmentQueue::NoteRefused() {
  {
    std::lock_guard lock(mutex_);
    incoming_.Release();
    Count(Acknowledgement::Verdict::kRejected, &statistics_);
    ++callbacks_due_;
  }
  changed_.notify_all();
}

void SegmentQueue::NoteDropped() {
  {
    std::lock_guard lock(mutex_);
    incoming_.Release();
    ++statistics_.dropped;
  }
  changed_.notify_all();
}

std::vector<std::uint64_t> SegmentQueue::TakeFinishedFiles() {
  std::lock_guard lock(mutex_);
  return std::exchange(finished_files_, {});
}

void SegmentQueue::ReportSpool(const SpoolReport& report) {
  {
    std::lock_guard lock(mutex_);
    spool_ = report;
    reserved_ = false;
  }
  changed_.notify_all();
}

void SegmentQueue::Finish() {
  {
    std::lock_guard lock(mutex_);
    stop_ = true;
    finish_ = true;
  }
  work_.notify_one();
}

std::optional<EncodedSegment> SegmentQueue::TakeOldest() {
  std::lock_guard lock(mutex_);
  return window_.TakeOldest();
}

// Number of segments for which Push leaves room: those in the window, and one
// that is read from disk now or later.
std::size_t SegmentQueue::KeptFromPush() const {
  const std::size_t kept = window_.size() + (reserved_ ? 1 : 0);
  return std::max<std::size_t>(kept, spool_.has_unloaded ? 1 : 0);
}

SegmentQueue::State SegmentQueue::StateLocked() const {
  return {incoming_.waiting(),
          window_.size(),
          InMemory(),
          finished_files_.size(),
          finish_};
}

}  // namespace selfcal::client
