// The raw content of one motion segment, complete but not yet assembled.
// Closing a segment only moves a few pointers. Assemble does what takes time
// (it selects the landmarks that are seen often enough and assigns indices) and
// need not run on the thread of the SLAM system: SegmentStream::Send accepts a
// ClosedSegment.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "core/model/segment.h"

namespace selfcal::client {

// One observation of a landmark in a keyframe, as the SLAM system reports it.
struct KeyframeObservation {
  std::int32_t camera = 0;
  std::uint64_t landmark_id = 0;
  Eigen::Vector2d z_px = Eigen::Vector2d::Zero();
  // Estimated position of the landmark [m].
  Eigen::Vector3d p_G = Eigen::Vector3d::Zero();
};

// A keyframe with its observations.
struct ObservedKeyframe {
  KeyframeState state;
  std::vector<KeyframeObservation> observations;
};

struct ClosedSegment {
  SegmentKey key;
  std::int64_t calibration_version = 1;
  // Landmarks with fewer observations in the segment are excluded.
  int min_observations = 3;
  std::vector<ObservedKeyframe> keyframes;  // at least one, in order of time
  // Strictly increasing in time; samples far outside the segment are excluded.
  std::vector<ImuSample> imu;
  std::int64_t end_ns = 0;  // time to which the segment's samples reach
  std::optional<double> temperature_c = std::nullopt;  // of the device
};

// Assembles the segment. If a camera observes a landmark several times in one
// keyframe, the first observation is used; if a landmark has several positions,
// the last is used. Throws std::bad_alloc.
MotionSegment Assemble(const ClosedSegment& closed);

}  // namespace selfcal::client
