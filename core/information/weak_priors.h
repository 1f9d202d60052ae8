// Very weak proper priors of a score, centred at the linearisation point. They
// make every problem positive definite, also for a device at rest or without a
// single observation. Each is a standard deviation far beyond any possible
// value within a segment, and far beyond what theta's own prior could explain:
// at rest, a scale error of the accelerometer of 0.4 looks like a bias of 4
// m/s^2, and must remain indistinguishable from it.
//
// Velocity and biases have a prior on the first keyframe only, from which the
// inertial factors propagate it: with one on every keyframe, its weight would
// grow with their number. Tilt has a prior on the keyframe that holds the
// gauge.
#pragma once

namespace selfcal {

inline constexpr double kLandmarkPriorSigma_m = 1e3;
inline constexpr double kVelocityPriorSigma_mps = 1e2;
inline constexpr double kAccelBiasPriorSigma_mps2 = 1e2;
inline constexpr double kGyroBiasPriorSigma_radps = 10;
// Sigma of roll and pitch: needed in free fall only, where gravity is
// unobservable.
inline constexpr double kTiltPriorSigma_rad = 10;

}  // namespace selfcal
