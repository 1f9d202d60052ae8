// Poses of the body at the exposures of the pixels of a segment: the states of
// its keyframes, moved along its samples by the time offsets and line delays of
// the cameras. Internal to core/preflight.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <vector>

#include "core/factor/keyframe_motion.h"
#include "core/model/calibration.h"
#include "core/model/rig.h"
#include "core/model/segment.h"

namespace selfcal {

struct BodyPose {
  Eigen::Quaterniond q_GI;
  Eigen::Vector3d p_GI;

  Eigen::Vector3d ToG(const Eigen::Vector3d& p_I) const {
    return q_GI * p_I + p_GI;
  }
};

BodyPose PoseOf(const KeyframeState& state);

// True if the indices of keyframe and landmark, and the numbers that they lead
// to, can be used.
bool IsUsable(const MotionSegment& segment, const Observation& o);

// theta with the time offsets as they are from states that hold late_s after
// their stamps.
Calibration FromStates(const Calibration& theta, double late_s);

// The segment, which need not be valid, must outlive this. The states of
// keyframes that cannot be moved, for lack of samples or of numbers, are used
// as they are.
class ExposurePoses {
 public:
  // The states of the segment hold late_s after their stamps.
  ExposurePoses(const Rig& rig,
                const Calibration& theta,
                const MotionSegment& segment,
                double late_s);

  // The observation must be usable, by a camera of theta.
  BodyPose At(const Observation& o) const;

 private:
  const MotionSegment& segment_;
  const Calibration theta_;  // from the states
  KeyframeMotions motions_;
};

}  // namespace selfcal
