// Solves a round of a calibration with Ceres: dogleg, elimination of landmarks
// first, then a sparse factorisation of the remaining system.
#pragma once

#include <vector>

#include "core/calibration/solver.h"

namespace selfcal {

// Implements SolveRound.
SolverOutcome SolveRoundByCeres(const SolverRound& round,
                                const SolverCallback& callback,
                                CalibrationEstimate* estimate,
                                std::vector<ScreenedLandmark>* landmarks);

}  // namespace selfcal
