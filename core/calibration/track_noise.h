// How far the pixel errors of a track go together.
//
// A feature tracker drifts: the errors of one track are alike from one keyframe
// to the next, and many observations of a landmark then say less than as many
// independent ones. What that does to theta is seen in the residuals. Each
// landmark m contributes to the gradient by theta
//   g_m = sum over its observations of weight (dr / dtheta)^T r,
// where r follows theta together with keyframes and landmarks. If errors are
// independent, sum g_m g_m^T is the information that the tracks bring; if they
// go together within tracks, it is larger, and the covariance of theta with it
// (the cluster-robust covariance of Liang and Zeger, "Longitudinal data
// analysis using generalized linear models", 1986, with tracks as clusters).
//
// Pure, any thread, deterministic.
#pragma once

#include <vector>

#include "core/calibration/screening.h"
#include "core/calibration/structured_solver.h"

namespace selfcal {

// The factor by which the pixel sigma must be taken larger (or smaller) for the
// information of the tracks to be as large as what their residuals show: the
// root of the ratio of the two, over all directions that the round estimates,
// each in units of its own sigma. 1 where errors are independent and of the
// size that the rig says, whatever the loss; where the pixel sigma is wrong,
// what that makes the sigmas of theta wrong by. The landmarks must be at the
// minimum of their residuals, theta and keyframes near that of the round, which
// was linearised there with its loss. 0 where there is too little to tell.
double TrackNoiseFactor(const SolverRound& round,
                        const LinearisedRound& linearised,
                        const CalibrationEstimate& estimate,
                        const std::vector<ScreenedLandmark>& landmarks);

}  // namespace selfcal
