// track: streams a recording to a daemon.
#include <fmt/format.h>

#include <memory>
#include <string>

#include "client/cli/commands.h"
#include "client/cli/recorded_sessions.h"
#include "client/cli/recording_feed.h"
#include "client/text/text.h"

namespace selfcal::client {
namespace {

struct TrackOptions {
  std::string rig;
  RecordingsInput recordings;
};

int Track(Context* context, const TrackOptions& options) {
  auto sessions = OpenSessions(options.recordings);
  if (!sessions.ok()) return FailInput(sessions.status());
  FeedCounts counts;
  for (RecordedSession& session : *sessions) {
    const int code = FeedRecording(
        context, options.rig, options.recordings, &session, &counts);
    if (code != kDone) return code;
  }
  PrintText(fmt::format("{} stored, {} left out\n",
                        CountText(counts.sent, "segment"),
                        counts.failed));
  return counts.failed == 0 ? kDone : kFailed;
}

}  // namespace

void AddTrack(CLI::App* app, Context* context) {
  CLI::App* command = app->add_subcommand(
      "track",
      "Track features through recordings, estimate the motion with the active "
      "calibration of a rig, and send the segments");
  const auto options = std::make_shared<TrackOptions>();
  command->add_option("RIG", options->rig)->required();
  AddRecordingsOptions(command, &options->recordings);
  command->callback([context, options] {
    context->command = [context, options] { return Track(context, *options); };
  });
}

}  // namespace selfcal::client
