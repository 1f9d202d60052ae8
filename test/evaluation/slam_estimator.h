// States of a session as a SLAM system estimates them that runs on a wrong
// calibration: fitted to the very pixels and IMU samples of its segments, so
// that their errors go together along the trajectory and with the noise, as
// those of Simulate() do not.
#pragma once

#include <vector>

#include "core/model/calibration.h"
#include "core/model/rig.h"
#include "core/model/segment.h"

namespace selfcal {

struct SlamEstimatorOptions {
  // Segments that are estimated together. Position and heading restart with
  // each stretch, where the states that are given have them.
  int stretch = 5;
  int max_iterations = 12;
  // Of a landmark, about where it is given: part of its distance from the
  // keyframe that saw it first. A map knows no more of a far point.
  double landmark_sigma_relative = 0.3;
};

// Keyframe states and landmarks of consecutive segments of one session at the
// minimum of all reprojection and inertial errors with the calibration held at
// theta_slam, by Ceres, from the states that they have. Deterministic.
std::vector<MotionSegment> EstimateStates(
    const Rig& rig,
    const Calibration& theta_slam,
    const std::vector<MotionSegment>& session,
    const SlamEstimatorOptions& options = {});

}  // namespace selfcal
