// Reads maplab VI-maps (each is a folder) into keyframes, IMU samples and a
// rig.
//
// Malformed and truncated files result in INVALID_ARGUMENT or DATA_LOSS, with
// the name of the file and the field; nothing aborts.
#pragma once

#include <absl/status/statusor.h>

#include <string>
#include <vector>

#include "client/selfcal/segment_builder.h"
#include "core/model/rig.h"
#include "core/model/segment.h"

namespace selfcal::client {

struct ViMapKeyframe {
  KeyframeState state;
  std::vector<KeyframeObservation> observations;
};

// One recording: a single unbroken chain of keyframes.
struct ViMapRecording {
  Rig rig;              // id empty; factory = the stored calibration
  std::string session;  // the id of the mission
  std::vector<ViMapKeyframe> keyframes;  // in time order
  std::vector<ImuSample> imu;            // one stream, duplicates dropped
};

struct ViMapOptions {
  bool good_landmarks_only = true;  // only landmarks of quality 2
};

// Returns true for a folder that is a VI-map or holds submap_0, a VI-map, and
// for the vi_map/ within one, for which ReadViMap names the right folder.
bool IsViMap(const std::string& folder);

// Reads the map in `folder`, or, if it holds submap_0, submap_1, ..., all of
// them joined into one session (landmark ids stay separate for each submap).
absl::StatusOr<ViMapRecording> ReadViMap(const std::string& folder,
                                         const ViMapOptions& options);

// Reads several consecutive maps into one recording.
absl::StatusOr<ViMapRecording> ReadViMaps(
    const std::vector<std::string>& folders, const ViMapOptions& options);

// Builds the segments of the recording with SegmentBuilder. The remainder at
// the end that does not fill a segment is dropped.
std::vector<MotionSegment> BuildSegments(const ViMapRecording& recording,
                                         const SegmentBuilderOptions& options);

}  // namespace selfcal::client
