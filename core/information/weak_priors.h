// The very weak proper priors under the score, centred at the linearisation
// point: they make every problem positive definite, also that of a device at
// rest or without a single observation, and are far too weak to matter where
// the data says anything. Each is a standard deviation beyond what a device
// could show in a segment.
//
// A segment whose chain of inertial factors and observations fixes the states
// to about 0.1 m, 0.1 m/s and 0.01 rad is changed by less than 1e-5 nat.
#pragma once

namespace selfcal {

inline constexpr double kLandmarkPriorSigma_m = 1e3;
inline constexpr double kVelocityPriorSigma_mps = 1e2;
inline constexpr double kAccelBiasPriorSigma_mps2 = 10;
inline constexpr double kGyroBiasPriorSigma_radps = 1;
// Of roll and pitch of the keyframe that carries the gauge: needed in free fall
// only, where nothing shows which way is down.
inline constexpr double kTiltPriorSigma_rad = 10;

}  // namespace selfcal
