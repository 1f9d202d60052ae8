#include "server/pipeline/rig_claims.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <random>
#include <set>
#include <utility>
#include <vector>

#include "server/pipeline/backoff.h"
#include "server/status/status_macros.h"

namespace selfcal::server {
namespace {

// Rigs that are claimed at a time, and the pause before the next ones: a daemon
// that has more to do leaves more to the others.
constexpr int kRigsAtATime = 8;
constexpr std::chrono::milliseconds kPause{20};
constexpr std::chrono::milliseconds kPauseForEach{10};
// A rig without work stays claimed for so long: its device sends more.
constexpr std::chrono::seconds kKeep{5};
// The database is away if it has not responded for so many beats.
constexpr int kBeatsToRespond = 5;

std::string NewName() {
  std::random_device random;
  return fmt::format(
      "{:08x}{:08x}{:08x}{:08x}", random(), random(), random(), random());
}

}  // namespace

RigClaims::RigClaims(Store* store,
                     const ReplicaOptions& options,
                     std::function<void()> on_beat)
    : store_(store), options_(options), on_beat_(std::move(on_beat)) {}

RigClaims::~RigClaims() { Stop(); }

absl::Status RigClaims::Start() {
  if (!options_.shared) return absl::OkStatus();
  SELFCAL_RETURN_IF_ERROR(Begin());
  const std::lock_guard lock(mutex_);
  running_ = true;
  thread_ = std::thread([this] { Run(); });
  return absl::OkStatus();
}

void RigClaims::Stop() {
  {
    const std::lock_guard lock(mutex_);
    running_ = false;
  }
  changed_.notify_all();
  if (!thread_.joinable()) return;
  thread_.join();
  // Its claims are free once its record is gone.
  const absl::Status removed = store_->replicas()->Remove(replica_);
  if (!removed.ok()) {
    spdlog::warn("others wait for the claims of this daemon to expire: {}",
                 removed.ToString());
  }
  const std::lock_guard lock(mutex_);
  replica_.clear();
  held_.clear();
}

std::string RigClaims::replica() const {
  const std::lock_guard lock(mutex_);
  return replica_;
}

std::optional<RigClaim> RigClaims::Find(const std::string& rig) const {
  if (!options_.shared) return RigClaim(rig);
  const std::lock_guard lock(mutex_);
  const auto held = held_.find(rig);
  if (held == held_.end()) return std::nullopt;
  return held->second.claim;
}

bool RigClaims::Holds(const RigClaim& claim) const {
  return Find(claim.rig) == claim;
}

bool RigClaims::IsFirst() const {
  if (!options_.shared) return true;
  const std::lock_guard lock(mutex_);
  return is_first_;
}

void RigClaims::Wake() {
  {
    const std::lock_guard lock(mutex_);
    woken_ = true;
  }
  changed_.notify_all();
}

bool RigClaims::Responds() const {
  if (!options_.shared) return true;
  const std::lock_guard lock(mutex_);
  return Clock::now() - responded_ < kBeatsToRespond * options_.beat;
}

void RigClaims::Run() {
  Backoff backoff;
  std::unique_lock lock(mutex_);
  while (running_) {
    woken_ = false;
    lock.unlock();
    auto pause = Pass();
    const bool responded = pause.ok();
    if (responded) {
      backoff.Reset();
    } else {
      spdlog::warn("cannot claim rigs: {}", pause.status().ToString());
      pause = std::min(backoff.Next(), options_.beat);
    }
    lock.lock();
    if (responded) responded_ = Clock::now();
    changed_.wait_for(lock, kPause, [this] { return !running_; });
    changed_.wait_for(lock, *pause, [this] { return !running_ || woken_; });
  }
}

absl::StatusOr<std::chrono::milliseconds> RigClaims::Pass() {
  const bool is_due = Clock::now() >= next_beat_;
  if (is_due) {
    SELFCAL_RETURN_IF_ERROR(Beat());
    next_beat_ = Clock::now() + options_.beat;
    SELFCAL_RETURN_IF_ERROR(RemoveSilent());
    SELFCAL_RETURN_IF_ERROR(Review());
  }
  const int busy = busy_;
  SELFCAL_ASSIGN_OR_RETURN(const bool more, ClaimMore());
  if (is_due || busy_ > busy) on_beat_();
  const auto until_beat = std::chrono::ceil<std::chrono::milliseconds>(
      std::max(next_beat_ - Clock::now(), Clock::duration::zero()));
  return more ? std::min(until_beat, kPauseForEach * busy_) : until_beat;
}

absl::Status RigClaims::Begin() {
  const std::string name = NewName();
  SELFCAL_RETURN_IF_ERROR(store_->replicas()->Add(name));
  seen_.clear();
  looked_.reset();
  next_beat_ = Clock::now();
  const std::lock_guard lock(mutex_);
  replica_ = name;
  held_.clear();
  busy_ = 0;
  is_first_ = false;
  responded_ = Clock::now();
  return absl::OkStatus();
}

absl::Status RigClaims::Beat() {
  const absl::Status status = store_->replicas()->Beat(replica());
  if (!absl::IsNotFound(status)) return status;
  spdlog::warn(
      "other daemons have taken this one for dead, and its work: it was "
      "stopped, or had no connection, for longer than {} ms",
      options_.lease.count());
  return Begin();
}

absl::Status RigClaims::RemoveSilent() {
  SELFCAL_ASSIGN_OR_RETURN(const std::vector<ReplicaRecord> records,
                           store_->replicas()->List());
  const Clock::time_point now = Clock::now();
  // Nobody could beat while the database did not respond.
  const bool missed = !looked_ || now - *looked_ > 3 * options_.beat;
  looked_ = now;
  std::map<std::string, Seen> seen;
  std::string first = replica();
  for (const ReplicaRecord& record : records) {
    if (record.replica == replica()) continue;
    const auto before = seen_.find(record.replica);
    const bool has_grown =
        before == seen_.end() || before->second.beat != record.beat;
    const Clock::time_point since =
        has_grown || missed ? now : before->second.since;
    if (now - since > options_.lease) {
      spdlog::warn("daemon {} does not respond: its rigs are free",
                   record.replica);
      SELFCAL_RETURN_IF_ERROR(store_->replicas()->Remove(record));
      continue;
    }
    seen[record.replica] = {record.beat, since};
    first = std::min(first, record.replica);
  }
  seen_ = std::move(seen);
  const std::lock_guard lock(mutex_);
  is_first_ = first == replica_;
  return absl::OkStatus();
}

absl::Status RigClaims::Review() {
  SELFCAL_ASSIGN_OR_RETURN(const std::vector<RigClaim> listed,
                           store_->replicas()->ListBusy(replica()));
  std::set<std::string> busy;
  for (const RigClaim& claim : listed) busy.insert(claim.rig);
  const Clock::time_point now = Clock::now();
  std::vector<RigClaim> idle;
  {
    const std::lock_guard lock(mutex_);
    for (auto& [rig, held] : held_) {
      if (busy.contains(rig)) held.idle_since = now;
      if (now - held.idle_since > kKeep) idle.push_back(held.claim);
    }
    busy_ = static_cast<int>(busy.size());
  }
  // A claim, or its release, whose outcome was not known: with the number of
  // another claim, nothing that was begun before is written.
  for (const RigClaim& claim : listed) {
    if (!Holds(claim)) SELFCAL_RETURN_IF_ERROR(Claim(claim.rig));
  }
  for (const RigClaim& claim : idle) {
    if (Clock::now() >= next_beat_) break;  // after the next beat
    {
      const std::lock_guard lock(mutex_);
      held_.erase(claim.rig);
    }
    const absl::Status released = store_->replicas()->Release(claim);
    // A rig that was deleted has no claim any more.
    if (!released.ok() && !absl::IsNotFound(released)) return released;
  }
  return absl::OkStatus();
}

absl::Status RigClaims::Claim(const std::string& rig) {
  const auto claim = store_->replicas()->Claim(rig, replica());
  if (absl::IsNotFound(claim.status())) return absl::OkStatus();  // deleted
  SELFCAL_RETURN_IF_ERROR(claim.status());
  if (!*claim) return absl::OkStatus();
  const std::lock_guard lock(mutex_);
  held_.insert_or_assign(rig, Held{**claim, Clock::now()});
  return absl::OkStatus();
}

absl::StatusOr<bool> RigClaims::ClaimMore() {
  SELFCAL_ASSIGN_OR_RETURN(const std::vector<std::string> unclaimed,
                           store_->replicas()->ListUnclaimed(kRigsAtATime + 1));
  for (std::size_t i = 0; i < unclaimed.size() && i < kRigsAtATime; ++i) {
    SELFCAL_RETURN_IF_ERROR(Claim(unclaimed[i]));
    const std::lock_guard lock(mutex_);
    if (held_.contains(unclaimed[i])) ++busy_;
  }
  return unclaimed.size() > kRigsAtATime;
}

}  // namespace selfcal::server
