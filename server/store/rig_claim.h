// The right of one daemon to do the work of a rig, which is to score its
// segments and to execute its runs, where several daemons share a database.
//
// The claims of a rig are numbered, and the newest is the one that holds: a
// transaction on behalf of an older one changes nothing (Store::Transact). So a
// daemon that was stopped for a while, and whose rigs others have claimed
// since, cannot write what they have done already.
#pragma once

#include <absl/status/status.h>

#include <cstdint>
#include <string>
#include <utility>

namespace selfcal::server {

struct RigClaim {
  // The claim of a caller that needs none: the only daemon, or one that answers
  // a request, which any may.
  // NOLINTBEGIN(google-explicit-constructor): the name alone is such a claim
  RigClaim(std::string name) : rig(std::move(name)) {}
  RigClaim(const char* name) : rig(name) {}
  // NOLINTEND(google-explicit-constructor)
  RigClaim(std::string name, std::int64_t its_key, std::int64_t its_number)
      : rig(std::move(name)), key(its_key), number(its_number) {}

  std::string rig;
  std::int64_t key = 0;     // of the rig: another one may get its name
  std::int64_t number = 0;  // from 1 in a rig; 0: none is needed

  friend bool operator==(const RigClaim&, const RigClaim&) = default;
};

// The error of a transaction whose claim does not hold any more.
absl::Status ClaimLost(const RigClaim& claim);
bool IsClaimLost(const absl::Status& status);

}  // namespace selfcal::server
