// The recording that a command reads, and the flags that say how.
#pragma once

#include <absl/status/statusor.h>

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "client/import/vi_map.h"
#include "client/selfcal/segment_builder.h"
#include "core/model/rig.h"
#include "core/model/segment.h"

namespace selfcal::client {

struct RecordingInput {
  std::vector<std::string> folders;
  SegmentBuilderOptions builder;
  bool all_landmarks = false;
};

struct RecordedSegments {
  Rig rig;  // of the map's own sensors, id empty
  std::vector<MotionSegment> segments;
};

// DIR..., --keyframes, --seconds, --min-observations, --all-landmarks. `input`
// must outlive the command.
void AddRecordingOptions(CLI::App* command, RecordingInput* input);

// Errors name the file; INVALID_ARGUMENT as well for a recording too short for
// one segment.
absl::StatusOr<RecordedSegments> ReadRecording(const RecordingInput& input);

}  // namespace selfcal::client
