// Reads maplab VI-maps (a folder each) into keyframes, IMU samples and a rig.
//
// Reads files, so it belongs to the client's side. Every malformed or truncated
// file gives INVALID_ARGUMENT or DATA_LOSS that names the file and the field;
// nothing aborts.
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
  std::string session;  // from the mission's id
  std::vector<ViMapKeyframe> keyframes;  // in time order
  std::vector<ImuSample> imu;            // one stream, duplicates dropped
};

struct ViMapOptions {
  bool good_landmarks_only = true;  // quality 2
};

// Reads the map in `folder`, or, if it holds submap_0, submap_1, ..., all of
// them joined into one session (landmark ids stay separate for each submap).
absl::StatusOr<ViMapRecording> ReadViMap(const std::string& folder,
                                         const ViMapOptions& options);

// Several folders that continue each other.
absl::StatusOr<ViMapRecording> ReadViMaps(
    const std::vector<std::string>& folders, const ViMapOptions& options);

// Segments of the recording through SegmentBuilder. The rest at its end that
// does not fill a segment is left out.
std::vector<MotionSegment> BuildSegments(const ViMapRecording& recording,
                                         const SegmentBuilderOptions& options);

}  // namespace selfcal::client
