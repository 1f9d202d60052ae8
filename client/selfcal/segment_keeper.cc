// The keeper of the queue: the thread that encodes, spools and reads back, so
// that neither the SLAM system nor the sender has to wait for this work.
#include <sched.h>
#include <sys/resource.h>
#include <unistd.h>

#include <exception>
#include <utility>

#include "client/selfcal/segment_messages.h"
#include "client/selfcal/segment_queue.h"
#include "proto/resource_names.h"

namespace selfcal::client {
namespace {

// Time between retries after the disk was full or failed.
constexpr std::chrono::milliseconds kSpoolRetry{1000};

// Prevents this thread from preempting the thread that wakes it, which is the
// SLAM system's. Without the permission to do so, it continues as it is.
void LowerPriority() {
  constexpr int kNice = 10;
  const sched_param parameters{};
  sched_setscheduler(0, SCHED_BATCH, &parameters);
  setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), kNice);
}

}  // namespace

void SegmentQueue::Keep() {
  LowerPriority();
  OpenSpool();
  Lock lock(mutex_);
  while (!finish_) {
    const auto due = [this] { return finish_ || HasPending(); };
    if (!spool_blocked_) {
      work_.wait(lock, due);
    } else if (!work_.wait_for(lock, kSpoolRetry, due)) {
      spool_blocked_ = false;
    }
    if (finish_ || !HasPending()) continue;
    try {
      ProcessPending(lock);
    } catch (const std::exception&) {  // out of memory
      if (!lock.owns_lock()) lock.lock();
      if (admitting_ && !pending_.has_value()) {
        ++statistics_.dropped;
        admitting_ = false;
      }
      spool_blocked_ = true;
    }
  }
  try {
    SpoolRest(lock);
  } catch (const std::exception&) {  // out of memory: the rest is lost
  }
}

void SegmentQueue::OpenSpool() {
  absl::Status status;
  if (!options_.spool_dir.empty()) {
    try {
      if (!ParseRigName(RigName(options_.rig)).has_value()) {
        status =
            absl::InvalidArgumentError("no spool: the rig has no valid name");
      } else if (auto spool = Spool::Open(
                     std::filesystem::path(options_.spool_dir) / options_.rig,
                     options_.max_spool_bytes);
                 spool.ok()) {
        spool_ = *std::move(spool);
        next_number_ = spool_->next_number();
      } else {
        status = spool.status();
      }
    } catch (const std::exception&) {
      status = absl::Status(absl::StatusCode::kResourceExhausted, "");
    }
  }
  {
    std::lock_guard lock(mutex_);
    spool_ready_ = true;
    spool_status_ = status;
    if (!status.ok()) ++statistics_.spool_failures;
    NoteSpool();
    statistics_.spool_recovered = statistics_.spool_segments;
  }
  changed_.notify_all();
}

bool SegmentQueue::HasPending() const {
  return !finished_files_.empty() || CanLoad() || CanAdmit();
}

bool SegmentQueue::CanLoad() const {
  return spool_ != nullptr && !spool_blocked_ && head_.size() < max_head_ &&
         spool_->FirstFrom(loaded_ + 1).has_value();
}

// True if no segment on disk comes before the one that is admitted now, and the
// head has room.
bool SegmentQueue::HeadIsNext() const {
  const bool none =
      spool_ == nullptr || !spool_->FirstFrom(loaded_ + 1).has_value();
  return none && head_.size() < max_head_;
}

bool SegmentQueue::CanAdmit() const {
  if (incoming_.empty() && !pending_.has_value()) return false;
  return HeadIsNext() || (spool_ != nullptr && !spool_blocked_) ||
         (spool_ == nullptr && head_.size() < max_held_);
}

void SegmentQueue::ProcessPending(Lock& lock) {
  if (!finished_files_.empty()) {
    RemoveFiles(lock);
  } else if (CanAdmit() && (!head_.empty() || !CanLoad())) {
    Admit(lock);  // first, because the SLAM system does not wait
  } else {
    Load(lock);
  }
}

void SegmentQueue::RemoveFiles(Lock& lock) {
  const std::vector<std::uint64_t> files = std::exchange(finished_files_, {});
  lock.unlock();
  for (const std::uint64_t number : files) spool_->Remove(number);
  lock.lock();
  spool_blocked_ = false;  // there is room again
  NoteSpool();
  changed_.notify_all();
}

void SegmentQueue::Load(Lock& lock) {
  const std::uint64_t number = *spool_->FirstFrom(loaded_ + 1);
  lock.unlock();
  const auto payload = spool_->Read(number);
  auto request = std::make_shared<Request>();
  absl::Status status = payload.status();
  if (status.ok() && (!request->ParseFromString(*payload) ||
                      request->parent() != RigName(options_.rig))) {
    status = absl::DataLossError("a file of the spool is of another rig");
  }
  if (absl::IsDataLoss(status)) spool_->Quarantine(number);
  lock.lock();
  if (status.ok()) {
    const SegmentKey key{request->segment().session(),
                         request->segment().index()};
    head_.push_back({number, key, std::move(request), true, false});
    loaded_ = number;
  } else {
    spool_status_ = status;
    if (absl::IsDataLoss(status)) {
      ++statistics_.spool_damaged;
    } else {
      ++statistics_.spool_failures;
      spool_blocked_ = true;
    }
  }
  NoteSpool();
  changed_.notify_all();
}

void SegmentQueue::Admit(Lock& lock) {
  if (!pending_.has_value()) {
    admitting_ = true;
    Material material = std::move(incoming_.front());
    incoming_.pop_front();
    pending_ = Prepare(std::move(material), lock);
  }
  if (pending_.has_value() && !HeadIsNext() && spool_ != nullptr) {
    Write(lock);
  } else if (pending_.has_value()) {
    head_.push_back(*std::move(pending_));
    pending_.reset();
  }
  admitting_ = pending_.has_value();
  changed_.notify_all();
}

// Assembles and encodes a segment. Returns with the lock held; nullopt if the
// segment does not fit into a message.
std::optional<SegmentQueue::Entry> SegmentQueue::Prepare(Material material,
                                                         Lock& lock) {
  lock.unlock();
  if (const auto* closed = std::get_if<ClosedSegment>(&material)) {
    material = Assemble(*closed);
  }
  auto& segment = std::get<MotionSegment>(material);
  auto request = std::make_shared<Request>();
  auto violations = MakeRequest(options_.rig, segment, request.get());
  const SegmentKey key = segment.key;
  segment = MotionSegment();  // freed before another thread waits for the lock
  if (violations.empty()) {
    lock.lock();
    return Entry{next_number_++, key, std::move(request)};
  }
  {
    std::lock_guard count(mutex_);
    Count(Acknowledgement::Verdict::kRejected);
    ++callbacks_due_;
  }
  refuse_({key, Acknowledgement::Verdict::kRejected, std::move(violations)});
  lock.lock();
  return std::nullopt;
}

// Writes the pending segment to disk; it stays pending if that fails.
void SegmentQueue::Write(Lock& lock) {
  lock.unlock();
  const absl::Status status =
      spool_->Write(pending_->number, pending_->request->SerializeAsString());
  if (status.ok()) pending_.reset();
  lock.lock();
  spool_status_ = status;
  if (status.ok()) {
    ++statistics_.spooled;
  } else {
    if (!absl::IsResourceExhausted(status)) ++statistics_.spool_failures;
    spool_blocked_ = true;
  }
  NoteSpool();
}

void SegmentQueue::NoteSpool() {
  statistics_.spool_segments = spool_ == nullptr ? 0 : spool_->size();
  statistics_.spool_bytes = spool_ == nullptr ? 0 : spool_->bytes();
}

// Writes the segments that are in memory at the end to disk, oldest first.
void SegmentQueue::SpoolRest(Lock& lock) {
  if (spool_ == nullptr) return;
  RemoveFiles(lock);
  for (const Entry& entry : head_) {
    if (entry.on_disk) continue;
    if (!spool_->Write(entry.number, entry.request->SerializeAsString()).ok()) {
      return;
    }
  }
  while (pending_.has_value() || !incoming_.empty()) {
    if (!pending_.has_value()) {
      Material material = std::move(incoming_.front());
      incoming_.pop_front();
      pending_ = Prepare(std::move(material), lock);
    }
    if (!pending_.has_value()) continue;
    Write(lock);
    if (pending_.has_value()) return;
  }
}

}  // namespace selfcal::client
