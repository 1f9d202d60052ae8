#include "server/store/rig_claim.h"

#include <absl/strings/cord.h>
#include <fmt/format.h>

namespace selfcal::server {
namespace {

constexpr char kPayload[] = "selfcal/claim-lost";

}  // namespace

absl::Status ClaimLost(const RigClaim& claim) {
  absl::Status status = absl::CancelledError(fmt::format(
      "claim {} of rig {} does not hold any more: another daemon does its work",
      claim.number,
      claim.rig));
  status.SetPayload(kPayload, absl::Cord());
  return status;
}

bool IsClaimLost(const absl::Status& status) {
  return status.GetPayload(kPayload).has_value();
}

}  // namespace selfcal::server
