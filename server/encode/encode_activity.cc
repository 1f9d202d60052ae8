#include "server/encode/encode_activity.h"

#include <string>
#include <vector>

#include "proto/resource_names.h"
#include "server/domain/alarms.h"
#include "server/encode/set_time.h"
#include "server/encode/table_fill.h"

namespace selfcal::server {
namespace {

constexpr std::int64_t kUnreachableNs = std::int64_t{3600} * 1'000'000'000;

// The sentences of an alarm: one, or one for each table.
std::vector<std::string> SentencesOf(Alarm alarm, const RigSummary& rig) {
  switch (alarm) {
    case Alarm::kUnlikeCohort:
      return {"version " + std::to_string(rig.active_version) +
              " contradicts the other devices of its cohort; see in which "
              "components by 'selfcal cohort show'"};
    case Alarm::kDeviceChanged:
      return {"the device has changed since version " +
              std::to_string(rig.active_version) +
              " became active; move it until the tables are full"};
    case Alarm::kRejected:
      return {"version " + std::to_string(rig.newest_version) +
              " was rejected; see the reasons on its page"};
    case Alarm::kRunFailed:
      return {"run " + std::to_string(rig.newest_run) +
              " failed; see its message in the list of runs"};
    case Alarm::kTableStarved: {
      std::vector<std::string> sentences;
      for (const Table& table : rig.tables) {
        if (!table.starved()) continue;
        sentences.push_back(
            "the table '" + table.group +
            "' does not fill: the gain of the motion is too small");
      }
      return sentences;
    }
    case Alarm::kSilent:
      return {
          "its device has not reported for a day: see whether it runs and "
          "reaches the hub"};
  }
  return {};
}

// The alarm of a device alone, whose hub knows nothing of it.
void AddUplinkAlarm(const RigSummary& rig,
                    std::int64_t now_ns,
                    v1::RigActivity* message) {
  if (!rig.uplink || rig.uplink->waiting == 0 ||
      now_ns - rig.uplink->time_ns <= kUnreachableNs) {
    return;
  }
  message->add_alarms(
      std::to_string(rig.uplink->waiting) +
      " records wait to be reported: the hub has taken no report for an hour; "
      "see the log for why");
}

v1::ReportState Encode(const ReportState& state) {
  v1::ReportState message;
  if (state.time_ns != 0) SetTime(state.time_ns, message.mutable_time());
  message.set_waiting(state.waiting);
  message.set_program_version(state.program_version);
  return message;
}

}  // namespace

v1::RigActivity Encode(const RigSummary& rig, std::int64_t now_ns) {
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
  for (const Alarm alarm : AlarmsOf(rig, now_ns)) {
    for (const std::string& sentence : SentencesOf(alarm, rig)) {
      message.add_alarms(sentence);
    }
  }
  AddUplinkAlarm(rig, now_ns, &message);
  if (rig.uplink) *message.mutable_uplink() = Encode(*rig.uplink);
  if (rig.device) *message.mutable_device() = Encode(*rig.device);
  return message;
}

}  // namespace selfcal::server
