#include "server/pipeline/backlog.h"

#include <algorithm>
#include <chrono>
#include <tuple>

namespace selfcal::server {
namespace {

// Delay after which a waiting Take notices that its caller has gone.
constexpr std::chrono::milliseconds kCancelPoll{50};

}  // namespace

void Backlog::Open(std::map<std::string, int> taken) {
  const std::lock_guard lock(mutex_);
  taken_ = std::move(taken);
  total_ = 0;
  for (const auto& [rig, places] : taken_) total_ += places;
  open_ = true;
}

void Backlog::Close() {
  {
    const std::lock_guard lock(mutex_);
    open_ = false;
  }
  changed_.notify_all();
}

int Backlog::TakenBy(const std::string& rig) const {
  const auto taken = taken_.find(rig);
  return taken == taken_.end() ? 0 : taken->second;
}

bool Backlog::IsNext(std::int64_t ticket, const std::string& rig) const {
  const int own = TakenBy(rig);
  if (own > 0 && total_ >= limit_) return false;
  return std::all_of(waiting_.begin(), waiting_.end(), [&](const auto& other) {
    return std::tuple(own, ticket) <=
           std::tuple(TakenBy(other.second), other.first);
  });
}

absl::Status Backlog::Take(const std::string& rig,
                           const std::function<bool()>& cancelled) {
  std::unique_lock lock(mutex_);
  const std::int64_t ticket = next_ticket_++;
  waiting_[ticket] = rig;
  bool gone = false;
  while (open_ && !gone && !IsNext(ticket, rig)) {
    lock.unlock();
    gone = cancelled && cancelled();
    lock.lock();
    if (!gone) changed_.wait_for(lock, kCancelPoll);
  }
  waiting_.erase(ticket);
  changed_.notify_all();  // it is the next one's turn
  if (gone) return absl::CancelledError("the caller has gone");
  if (!open_) {
    return absl::UnavailableError("the daemon is stopping; send again later");
  }
  ++taken_[rig];
  ++total_;
  return absl::OkStatus();
}

void Backlog::Return(const std::string& rig, int places) {
  {
    const std::lock_guard lock(mutex_);
    const auto taken = taken_.find(rig);
    if (taken == taken_.end()) return;
    const int returned = std::min(places, taken->second);
    taken->second -= returned;
    total_ -= returned;
    if (taken->second == 0) taken_.erase(taken);
  }
  changed_.notify_all();
}

}  // namespace selfcal::server
