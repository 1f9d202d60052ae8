// Segments of a VI-map on the command line, and the options for cutting it.
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

struct ViMapInput {
  std::vector<std::string> folders;
  SegmentBuilderOptions builder;
  bool all_landmarks = false;
};

struct ViMapSegments {
  Rig rig;  // from the sensors of the map, id empty
  std::vector<MotionSegment> segments;
};

// Adds DIR..., --keyframes, --seconds, --min-observations and --all-landmarks.
// `input` must outlive the command.
void AddViMapOptions(CLI::App* command, ViMapInput* input);

// Reads the map and cuts it into segments, at least one. Errors name the file;
// INVALID_ARGUMENT also for a map that is too short for one segment.
absl::StatusOr<ViMapSegments> ReadViMapSegments(const ViMapInput& input);

}  // namespace selfcal::client
