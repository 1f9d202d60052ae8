// Estimates the noise scales of the rig's noise densities and pixel sigma from
// the residuals of a calibration: variance components by kind of residual.
//
// The method is restricted maximum likelihood (REML; the same as Helmert's
// variance components). With P the projection of the measurements on the part
// that no unknown can explain, the scale s_j of kind j, of covariance s_j^2
// V_j, solves
//   s_j^2 z^T P V_j P z  =  s_j^2 tr(P V_j):
// the weighted squares of its residuals equal its redundancy, the part of them
// that keyframes, landmarks and calibration do not absorb. Both sides follow
// from one elimination of the linear system and its back-substitution; no
// unknown is solved for again. Noise of gyroscope and accelerometer, which
// share the residuals of the preintegrated motion, is separated by their
// covariances.
//
// Pixels are weighted by the robust loss; their squares are compared with the
// expected weighted squares of normal residuals.
// Source: Patterson and Thompson, "Recovery of inter-block information when
// block sizes are unequal" (1971); Koch, "Parameter Estimation and Hypothesis
// Testing in Linear Models" (1999), section 3.6.
#pragma once

#include <vector>

#include "core/calibration/noise_scale.h"
#include "core/calibration/screening.h"
#include "core/calibration/solver.h"

namespace selfcal {

// The scales are relative to the noise of round.rig. A prior keeps them near
// the noise that the rig states (`stated`), and those of the IMU near each
// other: if only some are determined, the others follow.
//
// Call it at the end of a round, with `round` as it was solved, except that its
// loss suits residuals of the noise of round.rig, and that `landmarks` are
// without the track noise. `track_noise` is the result of
// TrackNoiseFactor (track_noise.h): if it exceeds the noise scale of pixels,
// errors are correlated along tracks, and the reprojections are weighted by it
// relative to all other factors. What is common to a track does not move one
// keyframe against the next, though, and independent errors of that size would
// explain motion that is the noise of the IMU. Nor do errors that change slowly
// (SuccessiveNoiseRatio), where images decide how keyframes move against each
// other. If either matters, the white noise of each sensor is the larger one of
// two estimates, with the track noise, and with the noise between successive
// keyframes. Returns an empty vector if the linear system fails.
std::vector<NoiseScale> EstimateNoiseScales(
    const Rig& stated,
    const SolverRound& round,
    const CalibrationEstimate& estimate,
    const std::vector<ScreenedLandmark>& landmarks,
    double track_noise);

}  // namespace selfcal
