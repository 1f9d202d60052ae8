// States of keyframes and landmarks from tracks and readings alone, by linear
// least squares: the start of estimate_motion.h.
//
// Given the rotations of the gyroscope, a landmark p_B, the centre o_B of the
// camera that observes it and its ray u_B satisfy u_B x (p_B - o_B) = 0, and
// o_B is linear in the unknowns of the path (exposure_path.h). Landmarks are
// eliminated; nine unknowns remain. Distances, by which these rows are divided,
// and robust weights are those of the last iterate; the length of gravity is
// known. Metric scale comes from the accelerometer.
// Source: the linear initialisation of Qin and Shen (IROS 2017) and the
// closed-form solution of Martinelli (IJCV 2014), with the landmarks as in the
// latter.
//
// Pure, callable from any thread.
#pragma once

#include <Eigen/Core>
#include <optional>

#include "core/model/calibration.h"
#include "core/model/rig.h"
#include "core/model/segment.h"

namespace selfcal {

// Knowledge of the first keyframe from before the segment.
struct MotionStart {
  Eigen::Vector3d b_a = Eigen::Vector3d::Zero();  // [m/s^2], in A
  Eigen::Vector3d b_g = Eigen::Vector3d::Zero();  // [rad/s], in I
  // The state of the first keyframe, carried on from what was before it: the
  // segment continues in its frame G.
  std::optional<KeyframeState> first = std::nullopt;
};

// Sets states and positions of landmarks of the segment from its times,
// readings and observations; what they hold before is not used. Without
// start.first, G has its origin at the first keyframe, and the yaw of the body
// there. Returns false if the tracks do not determine the motion. Needs at
// least two keyframes, and readings over all of them.
bool AlignMotion(const Rig& rig,
                 const Calibration& theta,
                 const MotionStart& start,
                 MotionSegment* segment);

}  // namespace selfcal
