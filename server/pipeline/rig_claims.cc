#include "server/pipeline/rig_claims.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <random>
#include <set>
#include <utility>
#include <vector>

#include "server/status/status_macros.h"
#include "server/store/replicas.h"

namespace selfcal::server {
namespace {

// Rigs that are claimed at a time, and the pause before the next ones: a daemon
// that has more to do leaves more to the others.
constexpr int kRigsAtATime = 8;
constexpr std::chrono::milliseconds kPause{20};
constexpr std::chrono::milliseconds kPauseForEach{10};
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
    : store_(store),
      options_(options),
      on_beat_(std::move(on_beat)),
      others_(options),
      thread_(kPause) {}

RigClaims::~RigClaims() { Stop(); }

absl::Status RigClaims::Start() {
  if (!options_.shared) return absl::OkStatus();
  SELFCAL_RETURN_IF_ERROR(Begin());
  thread_.Start([this, backoff = Backoff()]() mutable {
    return PassOrBackOff(&backoff);
  });
  return absl::OkStatus();
}

void RigClaims::Stop() {
  thread_.Stop();
  const std::string name = replica();
  if (name.empty()) return;
  // Its claims are free once its record is gone.
  const absl::Status removed = store_->replicas()->Remove(name);
  if (!removed.ok()) {
    spdlog::warn("others wait for the claims of this daemon to expire: {}",
                 removed.ToString());
  }
  held_.Reset("");
}

std::string RigClaims::replica() const { return held_.replica(); }

std::optional<RigClaim> RigClaims::Find(const std::string& rig) const {
  if (!options_.shared) return RigClaim(rig);
  return held_.Find(rig);
}

bool RigClaims::Holds(const RigClaim& claim) const {
  return Find(claim.rig) == claim;
}

bool RigClaims::IsFirst() const {
  if (!options_.shared) return true;
  const std::lock_guard lock(mutex_);
  return is_first_;
}

void RigClaims::Wake(const std::string& rig) {
  if (arriving_.Note(rig)) thread_.Wake();
}

bool RigClaims::Responds() const {
  if (!options_.shared) return true;
  const std::lock_guard lock(mutex_);
  return Clock::now() - responded_ < kBeatsToRespond * options_.beat;
}

std::chrono::milliseconds RigClaims::PassOrBackOff(Backoff* backoff) {
  const auto pause = Pass();
  if (!pause.ok()) {
    spdlog::warn("cannot claim rigs: {}", pause.status().ToString());
    return std::min(backoff->Next(), options_.beat);
  }
  backoff->Reset();
  const std::lock_guard lock(mutex_);
  responded_ = Clock::now();
  return *pause;
}

absl::StatusOr<std::chrono::milliseconds> RigClaims::Pass() {
  const bool is_due = Clock::now() >= next_beat_;
  if (is_due) {
    SELFCAL_RETURN_IF_ERROR(Beat());
    next_beat_ = Clock::now() + options_.beat;
    arriving_.ForgetForeign();
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
  others_.Clear();
  next_beat_ = Clock::now();
  busy_ = 0;
  held_.Reset(name);
  const std::lock_guard lock(mutex_);
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
  const OtherReplicas::Summary others =
      others_.Update(replica(), records, Clock::now());
  for (const ReplicaRecord& record : others.silent) {
    spdlog::warn("daemon {} does not respond: its rigs are free",
                 record.replica);
    SELFCAL_RETURN_IF_ERROR(store_->replicas()->Remove(record));
  }
  const std::lock_guard lock(mutex_);
  is_first_ = others.is_first;
  return absl::OkStatus();
}

absl::Status RigClaims::Review() {
  SELFCAL_ASSIGN_OR_RETURN(const std::vector<RigClaim> listed,
                           store_->replicas()->ListBusy(replica()));
  std::set<std::string> busy;
  for (const RigClaim& claim : listed) busy.insert(claim.rig);
  const std::vector<RigClaim> idle = held_.NoteBusy(busy, Clock::now());
  busy_ = static_cast<int>(busy.size());
  // A claim, or its release, whose outcome was not known: with the number of
  // another claim, nothing that was begun before is written.
  for (const RigClaim& claim : listed) {
    if (!Holds(claim)) SELFCAL_RETURN_IF_ERROR(Claim(claim.rig));
  }
  for (const RigClaim& claim : idle) {
    if (Clock::now() >= next_beat_) break;  // after the next beat
    held_.Remove(claim.rig);
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
  if (*claim) held_.Add(**claim, Clock::now());
  return absl::OkStatus();
}

absl::StatusOr<bool> RigClaims::ClaimMore() {
  std::set<std::string> arrived = arriving_.Take();
  SELFCAL_ASSIGN_OR_RETURN(const std::vector<std::string> unclaimed,
                           store_->replicas()->ListUnclaimed(kRigsAtATime + 1));
  for (std::size_t i = 0; i < unclaimed.size() && i < kRigsAtATime; ++i) {
    SELFCAL_RETURN_IF_ERROR(Claim(unclaimed[i]));
    if (held_.Find(unclaimed[i])) ++busy_;
  }
  const bool more = unclaimed.size() > kRigsAtATime;
  if (!more) {
    std::erase_if(arrived, [&](const auto& rig) { return held_.Find(rig); });
    arriving_.NoteForeign(arrived);
  }
  return more;
}

}  // namespace selfcal::server
