// What a linear system is linearised at.
#pragma once

#include <vector>

#include "core/calibration/chain_thetas.h"
#include "core/calibration/problem.h"
#include "core/calibration/screening.h"
#include "core/factor/keyframe_motion.h"
#include "core/model/calibration.h"
#include "core/model/rig.h"

namespace selfcal {

// A problem and an estimate of all its unknowns: theta_s of each chain, the
// state of each keyframe, and the position of each landmark with the
// observations that are used. `motions` are those of the problem's keyframes.
struct LinearPoint {
  const Rig& rig;
  const ChainThetas& thetas;  // of the problem's keyframes
  const CalibrationProblem& problem;
  const std::vector<KeyframeState>& keyframes;
  const KeyframeMotions& motions;
  const std::vector<ScreenedLandmark>& landmarks;
};

}  // namespace selfcal
