// The very weak proper priors under the score, centred at the linearisation
// point: they make every problem positive definite, also that of a device at
// rest or without a single observation. Each is a standard deviation far beyond
// what a device could show in a segment, and far beyond what theta's own prior
// could explain: at rest, a scale of the accelerometer that is off by 0.4 looks
// like a bias of 4 m/s^2, and must not be told from one.
//
// Velocity and biases have it on the first keyframe alone, from where the
// inertial factors carry it on: on every keyframe it would grow with their
// number. Tilt has it on the keyframe that carries the gauge.
#pragma once

namespace selfcal {

inline constexpr double kLandmarkPriorSigma_m = 1e3;
inline constexpr double kVelocityPriorSigma_mps = 1e2;
inline constexpr double kAccelBiasPriorSigma_mps2 = 1e2;
inline constexpr double kGyroBiasPriorSigma_radps = 10;
// Of roll and pitch: needed in free fall only, where nothing shows which way is
// down.
inline constexpr double kTiltPriorSigma_rad = 10;

}  // namespace selfcal
