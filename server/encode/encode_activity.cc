#include "server/encode/encode_activity.h"

#include <string>

#include "proto/resource_names.h"
#include "server/encode/set_time.h"
#include "server/encode/table_fill.h"

namespace selfcal::server {
namespace {

void AddAlarms(const RigSummary& rig, v1::RigActivity* message) {
  if (rig.newest_state == CalibrationState::kRejected) {
    message->add_alarms("version " + std::to_string(rig.newest_version) +
                        " was rejected; see the reasons on its page");
  }
  if (rig.run_state == RunState::kFailed) {
    message->add_alarms("run " + std::to_string(rig.newest_run) +
                        " failed; see its message in the list of runs");
  }
  if (rig.newest_change_ns > rig.active_since_ns) {
    message->add_alarms("the device has changed since version " +
                        std::to_string(rig.active_version) +
                        " became active; move it until the tables are full");
  }
  for (const Table& table : rig.tables) {
    if (!table.starved()) continue;
    message->add_alarms("the table '" + table.group +
                        "' does not fill: the gain of the motion is too small");
  }
}

}  // namespace

v1::RigActivity Encode(const RigSummary& rig) {
  v1::RigActivity message;
  message.set_name(RigName(rig.rig));
  SetTime(rig.create_time_ns, message.mutable_create_time());
  if (rig.last_seen_ns != 0) {
    SetTime(rig.last_seen_ns, message.mutable_last_seen());
  }
  message.set_active_version(rig.active_version);
  SetTime(rig.active_since_ns, message.mutable_active_since());
  const TableFill fill = FillOf(rig.tables);
  message.set_table_entries(fill.entries);
  message.set_table_capacity(fill.capacity);
  message.mutable_labels()->insert(rig.labels.begin(), rig.labels.end());
  AddAlarms(rig, &message);
  return message;
}

}  // namespace selfcal::server
