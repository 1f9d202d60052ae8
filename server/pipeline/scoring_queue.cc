#include "server/pipeline/scoring_queue.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>

#include "server/pipeline/backoff.h"

namespace selfcal::server {

ScoringQueue::ScoringQueue(const RigClaims* claims, ListUnscored list_unscored)
    : claims_(claims), list_unscored_(std::move(list_unscored)) {}

void ScoringQueue::Open() {
  const std::lock_guard lock(mutex_);
  open_ = true;
}

void ScoringQueue::Close() {
  {
    const std::lock_guard lock(mutex_);
    open_ = false;
  }
  changed_.notify_all();
}

void ScoringQueue::Wake() {
  {
    const std::lock_guard lock(mutex_);
    ++wakes_;
  }
  changed_.notify_all();
}

std::optional<ScoringQueue::Claim> ScoringQueue::Next() {
  Backoff backoff;
  for (;;) {
    std::unique_lock choosing(choosing_);
    std::unique_lock lock(mutex_);
    if (!open_) return std::nullopt;
    // A segment is either in the list, or its Wake is still to come.
    const std::int64_t seen = wakes_;
    lock.unlock();
    const auto unscored = list_unscored_();
    if (!unscored.ok()) {
      spdlog::error("cannot list what to score: {}",
                    unscored.status().ToString());
    }
    lock.lock();
    if (!open_) return std::nullopt;
    if (!unscored.ok()) {
      choosing.unlock();
      changed_.wait_for(lock, backoff.Next(), [this] { return !open_; });
      continue;
    }
    if (std::optional<Claim> next = Choose(*unscored)) {
      claimed_[next->rig].emplace(next->sequence, next->of_rig);
      return next;
    }
    choosing.unlock();
    changed_.wait(lock, [&] { return !open_ || wakes_ != seen; });
  }
}

std::optional<ScoringQueue::Claim> ScoringQueue::Choose(
    const std::vector<Store::Unscored>& unscored) {
  std::vector<Claim> claims;
  std::vector<FairOrder::Piece> pieces;
  for (const Store::Unscored& candidate : unscored) {
    // A rig's next is the oldest that nobody scores.
    if ((!claims.empty() && claims.back().rig == candidate.rig) ||
        changing_.contains(candidate.rig) ||
        IsClaimed(candidate.rig, candidate.sequence)) {
      continue;
    }
    const std::optional<RigClaim> rig = claims_->Find(candidate.rig);
    if (!rig || IsScoredUnderAnother(*rig)) continue;
    claims.push_back({candidate.rig, *rig, candidate.key, candidate.sequence});
    // The time of a score grows with the number of readings.
    pieces.push_back({candidate.rig, static_cast<double>(candidate.readings)});
  }
  const std::optional<std::size_t> next = order_.Take(pieces);
  if (!next) return std::nullopt;
  return claims[*next];
}

bool ScoringQueue::IsClaimed(const std::string& rig,
                             std::int64_t sequence) const {
  const auto claimed = claimed_.find(rig);
  return claimed != claimed_.end() && claimed->second.contains(sequence);
}

// The score of the older segment would be refused, and computed once more after
// that of this one.
bool ScoringQueue::IsScoredUnderAnother(const RigClaim& claim) const {
  const auto claimed = claimed_.find(claim.rig);
  return claimed != claimed_.end() &&
         std::any_of(
             claimed->second.begin(),
             claimed->second.end(),
             [&](const auto& scored) { return scored.second != claim; });
}

bool ScoringQueue::WaitForTurn(const Claim& claim) {
  std::unique_lock lock(mutex_);
  const auto is_oldest = [&] {
    return claimed_.at(claim.rig).begin()->first == claim.sequence;
  };
  changed_.wait(lock, [&] { return !open_ || is_oldest(); });
  return is_oldest();
}

void ScoringQueue::End(const Claim& claim) {
  {
    const std::lock_guard choosing(choosing_);
    const std::lock_guard lock(mutex_);
    const auto claimed = claimed_.find(claim.rig);
    claimed->second.erase(claim.sequence);
    if (claimed->second.empty()) claimed_.erase(claimed);
  }
  changed_.notify_all();
}

std::set<std::int64_t> ScoringQueue::BeginChange(const std::string& rig) {
  const std::lock_guard lock(mutex_);
  changing_.insert(rig);
  std::set<std::int64_t> sequences;
  const auto claimed = claimed_.find(rig);
  if (claimed == claimed_.end()) return sequences;
  for (const auto& [sequence, claim] : claimed->second) {
    sequences.insert(sequence);
  }
  return sequences;
}

void ScoringQueue::WaitForClaims(const std::string& rig) {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return !claimed_.contains(rig); });
}

void ScoringQueue::EndChange(const std::string& rig) {
  {
    const std::lock_guard choosing(choosing_);
    const std::lock_guard lock(mutex_);
    changing_.erase(changing_.find(rig));
    ++wakes_;  // what was passed over meanwhile is looked at again
  }
  changed_.notify_all();
}

bool ScoringQueue::Pause(std::chrono::milliseconds time) {
  std::unique_lock lock(mutex_);
  changed_.wait_for(lock, time, [this] { return !open_; });
  return open_;
}

}  // namespace selfcal::server
