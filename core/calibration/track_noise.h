// Measures the correlation of the pixel errors along a track.
//
// A feature tracker drifts: the errors of one track are similar from one
// keyframe to the next, and many observations of a landmark then have less
// information than as many independent ones. The effect on theta is visible in
// the residuals. Each landmark m contributes to the gradient with respect to
// theta
//   g_m = sum over its observations of weight (dr / dtheta)^T r,
// where r depends on theta together with keyframes and landmarks. If errors are
// independent, sum g_m g_m^T is the information of the tracks; if they are
// correlated within tracks, it is larger, and the covariance of theta with it
// (the cluster-robust covariance of Liang and Zeger, "Longitudinal data
// analysis using generalized linear models", 1986, with tracks as clusters).
//
// Pure, callable from any thread, deterministic.
#pragma once

#include <vector>

#include "core/calibration/screening.h"
#include "core/calibration/structured_solver.h"

namespace selfcal {

// Returns the factor on the pixel sigma for which the information of the tracks
// matches the scatter of their residuals: the root of the ratio of the two,
// over all directions that the round estimates, each in units of its own sigma.
// It is 1 if errors are independent and of the size that the rig states,
// whatever the loss; if the pixel sigma is wrong, it is the resulting error of
// the sigmas of theta. The landmarks must be at the minimum of their residuals,
// theta and keyframes near that of the round, which was linearised there with
// its loss. If their weights account for a factor already, the result is what
// exceeds it. Returns 0 if the data is insufficient.
double TrackNoiseFactor(const SolverRound& round,
                        const LinearisedRound& linearised,
                        const CalibrationEstimate& estimate,
                        const std::vector<ScreenedLandmark>& landmarks);

// Ratio, at most 1, of the noise of pixels from one keyframe to the next to
// that of all residuals. Independent errors have the same second differences
// along a track as at any distance; those of a tracker change slowly, and leave
// the motion between keyframes more certain than errors of their size would.
// It compares the median square of residuals with that of their second
// differences over three successive keyframes. 1 if the data is insufficient.
double SuccessiveNoiseRatio(const SolverRound& round,
                            const CalibrationEstimate& estimate,
                            const std::vector<ScreenedLandmark>& landmarks);

}  // namespace selfcal
