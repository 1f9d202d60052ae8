// The claims that this replica holds, as far as it knows, and for how long
// their rigs have had no work. Any thread may call.
#pragma once

#include <chrono>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "server/store/rig_claim.h"

namespace selfcal::server {

class HeldClaims {
 public:
  using Clock = std::chrono::steady_clock;
  // A rig without work stays claimed for so long: its device sends more.
  static constexpr std::chrono::seconds kKeep{5};

  // Drops all claims: `replica` has none yet, and an empty name never has one.
  void Reset(const std::string& replica);
  std::string replica() const;

  std::optional<RigClaim> Find(const std::string& rig) const;
  // Replaces an older claim of the rig, which has work at `now`.
  void Add(const RigClaim& claim, Clock::time_point now);
  void Remove(const std::string& rig);
  // Notes which rigs have work at `now`, and returns the claims of those that
  // have had none for longer than kKeep.
  std::vector<RigClaim> NoteBusy(const std::set<std::string>& rigs,
                                 Clock::time_point now);

 private:
  struct Held {
    RigClaim claim;
    Clock::time_point idle_since;  // had work up to then
  };

  mutable std::mutex mutex_;          // guards what follows
  std::string replica_;               // empty while there is no record of it
  std::map<std::string, Held> held_;  // by rig
};

}  // namespace selfcal::server
