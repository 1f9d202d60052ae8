#include "server/domain/rig_update.h"

#include <fmt/format.h>

#include <utility>

#include "server/domain/outdated_scores.h"
#include "server/status/status_macros.h"
#include "server/store/events.h"
#include "server/store/records.h"
#include "server/store/rigs.h"

namespace selfcal::server {
namespace {

// The rig without what can change, to compare the rest.
std::string Unchanging(StoredRig rig) {
  rig.policy = {};
  rig.labels.clear();
  rig.rig.prior_mean.reset();
  rig.rig.prior_sigmas.clear();
  rig.rig.min_gain_nats = 0;
  rig.rig.retrigger_fraction = 0;
  rig.rig.reweight_noise = false;
  rig.rig.imu_full_scale = {};
  rig.rig.imu1_full_scale = {};
  return SerializeRig(rig);
}

}  // namespace

absl::StatusOr<RigUpdate> UpdateRig(UnitOfWork* tx,
                                    const RigChange& change,
                                    const std::string& caller,
                                    const std::string& reason) {
  SELFCAL_ASSIGN_OR_RETURN(const StoredRig before, ReadRig(tx));
  SELFCAL_ASSIGN_OR_RETURN(StoredRig after, change(before));
  after.create_time_ns = before.create_time_ns;
  if (Unchanging(before) != Unchanging(after)) {
    return absl::InvalidArgumentError(
        "only labels, prior_mean, prior_sigmas, thresholds, ages, "
        "reweight_noise, imu and imu1 of a rig can change: what is stored was "
        "computed with the rest; create another rig");
  }
  if (SerializeRig(before) == SerializeRig(after)) {
    return RigUpdate{std::move(after), false};
  }
  SELFCAL_RETURN_IF_ERROR(WriteRig(tx, after));
  SELFCAL_RETURN_IF_ERROR(AppendEvent(
      tx,
      EventKind::kRigUpdated,
      fmt::format(
          "changed by {}{}{}", caller, reason.empty() ? "" : ": ", reason)));
  const bool rescore = PriorSigmas(before.rig) != PriorSigmas(after.rig);
  if (rescore) SELFCAL_RETURN_IF_ERROR(NoteOutdatedScores(tx));
  return RigUpdate{std::move(after), rescore};
}

}  // namespace selfcal::server
