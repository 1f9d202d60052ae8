#include "server/pipeline/held_claims.h"

namespace selfcal::server {

void HeldClaims::Reset(const std::string& replica) {
  const std::lock_guard lock(mutex_);
  replica_ = replica;
  held_.clear();
}

std::string HeldClaims::replica() const {
  const std::lock_guard lock(mutex_);
  return replica_;
}

std::optional<RigClaim> HeldClaims::Find(const std::string& rig) const {
  const std::lock_guard lock(mutex_);
  const auto held = held_.find(rig);
  if (held == held_.end()) return std::nullopt;
  return held->second.claim;
}

void HeldClaims::Add(const RigClaim& claim, Clock::time_point now) {
  const std::lock_guard lock(mutex_);
  held_.insert_or_assign(claim.rig, Held{claim, now});
}

void HeldClaims::Remove(const std::string& rig) {
  const std::lock_guard lock(mutex_);
  held_.erase(rig);
}

std::vector<RigClaim> HeldClaims::NoteBusy(const std::set<std::string>& rigs,
                                           Clock::time_point now) {
  std::vector<RigClaim> idle;
  const std::lock_guard lock(mutex_);
  for (auto& [rig, held] : held_) {
    if (rigs.contains(rig)) held.idle_since = now;
    if (now - held.idle_since > kKeep) idle.push_back(held.claim);
  }
  return idle;
}

}  // namespace selfcal::server
