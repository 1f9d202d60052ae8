// Feeds a recording to the daemon: images and readings become segments, which
// the daemon takes one after the other.
#pragma once

#include <string>

#include "client/cli/context.h"
#include "client/cli/recorded_sessions.h"

namespace selfcal::client {

struct FeedCounts {
  int sent = 0;    // stored by the daemon
  int failed = 0;  // segments without a motion, or that the daemon rejected
  bool continued = false;  // an earlier feed of this session had sent segments
};

// Sends the segments of a session, from the end of what the daemon has of it,
// to a rig; `input` states keyframes and temperature. Aligns its clocks first.
// The motion of each is estimated with the calibration that is active then: the
// next segment waits until the daemon has scored the one before and ended the
// run that it started, so that the same recording leads to the same calibration
// however fast the machine is. Shows progress, and prints a line for each
// segment whose motion was not found. Returns the exit code, after the error
// was printed.
int FeedRecording(Context* context,
                  const std::string& rig,
                  const RecordingsInput& input,
                  RecordedSession* session,
                  FeedCounts* counts);

}  // namespace selfcal::client
