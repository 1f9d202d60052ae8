// The recording that a command reads, and the options for reading it.
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
  Rig rig;  // from the sensors of the map, id empty
  std::vector<MotionSegment> segments;
};

// Adds DIR..., --keyframes, --seconds, --min-observations and --all-landmarks.
// `input` must outlive the command.
void AddRecordingOptions(CLI::App* command, RecordingInput* input);

// Reads the recording. Errors name the file; INVALID_ARGUMENT also if the
// recording is too short for one segment.
absl::StatusOr<RecordedSegments> ReadRecording(const RecordingInput& input);

}  // namespace selfcal::client
