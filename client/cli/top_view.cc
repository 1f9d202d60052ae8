#include "client/cli/top_view.h"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>

#include "client/text/text.h"

namespace selfcal::client {
namespace {

constexpr int kLinesAbove = 3;  // totals, an empty line, the headers

std::string RateText(const v1::SegmentTraffic& traffic) {
  return fmt::format("{:.1f}", traffic.stored_per_minute());
}

// Returns "3 running 4/100", "3 pending" or "-".
std::string RunText(const v1::RigActivity& rig) {
  if (!rig.has_run()) return "-";
  const v1::Recalibration& run = rig.run();
  std::string text =
      fmt::format("{} {}", LastPart(run.name()), StateText(run.state()));
  if (run.max_iterations() > 0) {
    text += fmt::format(" {}/{}", run.iteration(), run.max_iterations());
  }
  return text;
}

// The last report between a device and its hub, and the records that wait;
// "-" where there is no hub.
template <typename When>
std::string ReportText(const v1::RigActivity& rig, const When& when) {
  if (!rig.has_uplink() && !rig.has_device()) return "-";
  const v1::ReportState& state = rig.has_uplink() ? rig.uplink() : rig.device();
  std::string text = state.has_time() ? when(state.time()) : "never";
  if (state.waiting() > 0) text += fmt::format(", {} wait", state.waiting());
  return text;
}

// Removes the first line from *text and returns it.
std::string_view TakeLine(std::string_view* text) {
  const std::size_t end = std::min(text->find('\n'), text->size());
  const std::string_view line = text->substr(0, end);
  text->remove_prefix(std::min(end + 1, text->size()));
  return line;
}

}  // namespace

std::string AgeText(std::int64_t seconds) {
  seconds = std::max<std::int64_t>(seconds, 0);
  if (seconds < 120) return fmt::format("{} s", seconds);
  if (seconds < 2 * 3600) return fmt::format("{} min", seconds / 60);
  if (seconds < 2 * 86400) return fmt::format("{} h", seconds / 3600);
  return fmt::format("{} d", seconds / 86400);
}

Table ActivityTable(const v1::ListActivityResponse& activity, bool ages) {
  const auto when = [&](const google::protobuf::Timestamp& time) {
    return ages && time.seconds() != 0
               ? AgeText(activity.time().seconds() - time.seconds())
               : TimeText(time);
  };
  Table table({{"rig"},
               {"last seen", ages},
               {"version", true},
               {"active since", ages},
               {"tables", true},
               {"streams", true},
               {"stored", true},
               {"per min", true},
               {"rejected", true},
               {"run"},
               {"reports"}});
  for (const v1::RigActivity& rig : activity.rigs()) {
    table.Add({LastPart(rig.name()),
               when(rig.last_seen()),
               fmt::format("{}", rig.active_version()),
               when(rig.active_since()),
               fmt::format("{}/{}", rig.table_entries(), rig.table_capacity()),
               fmt::format("{}", rig.traffic().streams()),
               fmt::format("{}", rig.traffic().stored()),
               RateText(rig.traffic()),
               fmt::format("{}", rig.traffic().rejected()),
               RunText(rig),
               ReportText(rig, when)});
  }
  return table;
}

std::string ActivityScreen(const v1::ListActivityResponse& activity,
                           int columns,
                           int rows) {
  const v1::SegmentTraffic& all = activity.traffic();
  const std::string text =
      fmt::format(
          "{}  up {}  streams {}  stored {} ({} a minute)  rejected {}\n\n",
          TimeText(activity.time()),
          AgeText(activity.time().seconds() - activity.start_time().seconds()),
          all.streams(),
          all.stored(),
          RateText(all),
          all.rejected()) +
      ActivityTable(activity, true).Aligned();
  std::string screen;
  std::string_view rest = text;
  for (int row = 0; row < rows && !rest.empty(); ++row) {
    const std::string_view line = TakeLine(&rest);
    if (row > 0) screen += '\n';
    screen += line.substr(0, static_cast<std::size_t>(std::max(columns, 0)));
  }
  return screen;
}

int RigsOnScreen(int rows) { return std::max(rows - kLinesAbove, 1); }

}  // namespace selfcal::client
