#include "client/selfcal/keeper_step.h"

namespace selfcal::client {

KeeperStep NextStep(const KeeperSituation& now) {
  if (now.has_finished_files) return KeeperStep::kRemoveFiles;
  const bool can_append = now.window_has_room && !now.has_unloaded;
  const bool can_load = now.window_has_room && now.memory_has_room &&
                        now.has_unloaded && now.spool_is_usable;
  // Loading comes first only if the sender has nothing to do, because the SLAM
  // system does not wait.
  if (now.window_is_empty && can_load) return KeeperStep::kLoad;
  if (can_append || now.spool_is_usable) {
    if (now.has_encoded) {
      return can_append ? KeeperStep::kAppend : KeeperStep::kSpool;
    }
    if (now.has_incoming) return KeeperStep::kEncode;
  }
  return can_load ? KeeperStep::kLoad : KeeperStep::kWait;
}

}  // namespace selfcal::client
