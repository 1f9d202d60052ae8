// The raw content of one motion segment, complete but not yet assembled.
// Closing a segment only moves a few pointers. Assemble does what takes time
// (it moves states to the time of their images, triangulates tracks without a
// position, selects the landmarks that are seen often enough and assigns
// indices) and need not run on the thread of the SLAM system:
// SegmentStream::Send accepts a ClosedSegment.
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <vector>

#include "core/model/calibration.h"
#include "core/model/segment.h"

namespace selfcal::client {

// One observation of a landmark in a keyframe, as the SLAM system reports it.
struct KeyframeObservation {
  std::int32_t camera = 0;
  // Id of the landmark, or of the track if the SLAM system has no landmark.
  std::uint64_t landmark_id = 0;
  Eigen::Vector2d z_px = Eigen::Vector2d::Zero();
  // Estimated position of the landmark [m]; not finite if there is none (yet).
  // A landmark that has a position in no keyframe of a segment is triangulated
  // (ClosedSegment::theta).
  Eigen::Vector3d p_G =
      Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
};

// A keyframe with its observations.
struct ObservedKeyframe {
  KeyframeState state;  // its t_ns is the timestamp of the images
  std::vector<KeyframeObservation> observations;
  // The time at which the state holds, less the timestamp of the images.
  // Assemble moves the state to the timestamp.
  std::int64_t state_offset_ns = 0;
};

struct ClosedSegment {
  SegmentKey key;
  std::int64_t calibration_version = 1;
  // Landmarks with fewer observations in the segment are excluded.
  int min_observations = 3;
  std::vector<ObservedKeyframe> keyframes;  // at least one, in order of time
  // Strictly increasing in time; samples far outside the segment are excluded.
  std::vector<ImuSample> imu;
  std::vector<ImuSample> imu1 = {};  // of the second IMU, if there is one
  // Times from and to which the samples are part of the segment.
  std::int64_t begin_ns = 0;
  std::int64_t end_ns = 0;
  std::optional<double> temperature_c = std::nullopt;  // of the device
  std::optional<std::int64_t> session_start_ns = std::nullopt;
  // The calibration that the SLAM system used, a valid one, or null if it is
  // not known: then landmarks without a position are left out, and states are
  // moved with the readings as they are, less their biases.
  std::shared_ptr<const Calibration> theta = nullptr;
  double pixel_sigma_px = 1;   // of an observation
  double gravity_mps2 = 9.81;  // g = (0, 0, -gravity) in G
};

// Counts of landmarks that are seen often enough and came without a position.
struct AssemblyStatistics {
  std::uint64_t tracks_triangulated = 0;
  // Left out: too little parallax, not consistent, or theta is not known.
  std::uint64_t tracks_dropped = 0;
};

// Assembles the segment. If a camera observes a landmark several times in one
// keyframe, the first observation is used; if a landmark has several positions,
// the last is used. A landmark is triangulated if its observations determine
// its inverse depth to a quarter (1 sigma) and most of them agree. Adds to
// *statistics unless it is null. Throws std::bad_alloc.
MotionSegment Assemble(const ClosedSegment& closed,
                       AssemblyStatistics* statistics = nullptr);

}  // namespace selfcal::client
