// The material of one motion segment as it was collected, closed but not yet
// put together. Closing moves a few pointers; what takes time (which landmarks
// are seen often enough, their indices) is left to Assemble, which need not run
// on the thread of the SLAM system: SegmentStream::Send takes a ClosedSegment
// as it is.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "core/model/segment.h"

namespace selfcal::client {

// What the SLAM system says when it makes a keyframe.
struct KeyframeObservation {
  std::int32_t camera = 0;
  std::uint64_t landmark_id = 0;
  Eigen::Vector2d z_px = Eigen::Vector2d::Zero();
  Eigen::Vector3d p_G = Eigen::Vector3d::Zero();  // landmark's estimate [m]
};

// A keyframe with what it sees.
struct ObservedKeyframe {
  KeyframeState state;
  std::vector<KeyframeObservation> observations;
};

struct ClosedSegment {
  SegmentKey key;
  std::int64_t calibration_version = 1;
  // Landmarks seen fewer times in the segment are left out.
  int min_observations = 3;
  std::vector<ObservedKeyframe> keyframes;  // at least one, in order of time
  // Strictly increasing in time; those far outside are left out.
  std::vector<ImuSample> imu;
  std::int64_t end_ns = 0;  // where the samples of the segment end
  std::optional<double> temperature_c = std::nullopt;  // of the device
};

// The segment. Of several observations of one landmark by one camera in one
// keyframe the first counts, of the places of a landmark the last. Throws
// std::bad_alloc.
MotionSegment Assemble(const ClosedSegment& closed);

}  // namespace selfcal::client
