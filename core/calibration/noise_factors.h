// By which factors the rig's noise densities and pixel sigma are off, from the
// residuals of a calibration: variance components by kind of residual.
//
// Restricted maximum likelihood (REML; the same as Helmert's variance
// components): with P what projects the measurements on what no unknown can
// explain, the factor s_j of kind j, of covariance s_j^2 V_j, solves
//   s_j^2 z^T P V_j P z  =  s_j^2 tr(P V_j):
// the weighted squares of its residuals equal its redundancy, the part of them
// that keyframes, landmarks and calibration do not absorb. Both sides follow
// from one elimination of the linear system and its way back; no unknown is
// solved for again. Noise of gyroscope and accelerometer, which share the
// residuals of the preintegrated motion, are told apart by their covariances.
//
// Pixels are weighted by the robust loss; their squares are compared with what
// the weighted squares of normal residuals would be.
// Source: Patterson and Thompson, "Recovery of inter-block information when
// block sizes are unequal" (1971); Koch, "Parameter Estimation and Hypothesis
// Testing in Linear Models" (1999), section 3.6.
#pragma once

#include <vector>

#include "core/calibration/noise_factor.h"
#include "core/calibration/screening.h"
#include "core/calibration/solver.h"

namespace selfcal {

// Factors are over the noise of round.rig. Before residuals are looked at, they
// are not far from what the rig states (`stated`), and those of the IMU not far
// from each other: where only some are determined, the others follow.
//
// At the end of a round, with `round` as it was solved, but for landmarks
// without the track noise. That is as TrackNoiseFactor (track_noise.h): where
// it is larger than the pixel sigma is off, errors go together along tracks,
// and what reprojections say of all else is weighted by it. Empty where the
// linear system fails.
std::vector<NoiseFactor> EstimateNoiseFactors(
    const Rig& stated,
    const SolverRound& round,
    const CalibrationEstimate& estimate,
    const std::vector<ScreenedLandmark>& landmarks,
    double track_noise);

}  // namespace selfcal
