// A round of a calibration by Ceres: dogleg, landmarks eliminated first, then a
// sparse factorisation of what is left.
#pragma once

#include <vector>

#include "core/calibration/solver.h"

namespace selfcal {

// As SolveRound.
SolverOutcome SolveRoundByCeres(const SolverRound& round,
                                const SolverCallback& callback,
                                CalibrationEstimate* estimate,
                                std::vector<ScreenedLandmark>* landmarks);

}  // namespace selfcal
