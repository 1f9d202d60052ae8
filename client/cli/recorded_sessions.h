// The recordings on the command line: images or tracks, with readings, and maps
// of maplab.
#pragma once

#include <absl/status/statusor.h>

#include <CLI/CLI.hpp>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "client/cli/vi_map_input.h"
#include "client/recording/recording.h"

namespace selfcal::client {

struct RecordingsInput {
  std::vector<std::string> paths;
  RecordingOptions topics;
  int keyframes = 40;
  double keyframe_rate_hz = 10;
  std::optional<double> temperature_c = std::nullopt;
};

struct RecordedSession {
  std::string name;
  // One of these is there. A map has states that a SLAM system estimated, so
  // that neither a start nor the motion is looked for.
  std::unique_ptr<Recording> recording;
  std::optional<ViMapSegments> map;
  bool clocks_agree = false;  // after AlignClocks (clock_alignment.h)
};

int CameraCount(const RecordedSession& session);
// Readings of the session; of a map those of its first segment.
std::span<const ImuSample> Readings(const RecordedSession& session);

// INVALID_ARGUMENT if the rig has a second IMU and the session has no readings
// of it.
absl::Status CheckImus(const RecordedSession& session, bool rig_has_second);

// Adds RECORDING..., --camera-topic, --imu-topic, --keyframes, --keyframe-rate
// and --temperature. `input` must outlive the command.
void AddRecordingsOptions(CLI::App* command, RecordingsInput* input);

// Opens all recordings, and prints what was left out of them. A session has the
// name of its file, without folder and ending, and the time of the first image
// or keyframe [ms]: another recording of the same name is another session.
// INVALID_ARGUMENT for recordings with different numbers of cameras.
absl::StatusOr<std::vector<RecordedSession>> OpenSessions(
    const RecordingsInput& input);

}  // namespace selfcal::client
