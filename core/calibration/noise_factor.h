// What residuals say about the noise that a rig is believed to have.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/model/rig.h"

namespace selfcal {

// In the order of NoiseFactors.
enum class NoiseKind {
  kPixel,
  kGyro,
  kAccel,
  kGyroBiasWalk,
  kAccelBiasWalk,
};
inline constexpr int kNoiseKinds = 5;

// A factor counts as determined below this standard deviation of its
// logarithm: 20 % are then two of them.
inline constexpr double kDeterminedLogSigma = 0.1;

// The noise of one kind is this many times what the rig says.
struct NoiseFactor {
  NoiseKind kind = NoiseKind::kPixel;
  double factor = 1;
  double log_sigma = 0;  // standard deviation of the logarithm of the factor
  // So many residuals of this kind, whitened, are left to tell by.
  double redundancy = 0;
  // The calibration was weighted with noise of this many times what the rig
  // states.
  double used = 1;
  // The estimate of the factors converged; else the factor is where it stopped.
  bool converged = true;

  bool determined() const { return log_sigma < kDeterminedLogSigma; }
};

// "pixel", "gyro", "accel", "gyro_bias_walk", "accel_bias_walk".
std::string NoiseKindName(NoiseKind kind);
std::optional<NoiseKind> FindNoiseKind(const std::string& name);

// The sigma of a kind as a rig states it, in the unit of the rig.
double NoiseOf(NoiseKind kind, const Rig& rig);
void ScaleNoise(NoiseKind kind, double factor, Rig* rig);

// The rig with the noise that `factors`, found with the noise of `taken`,
// suggest: those that are determined, or larger than one by more than one of
// their standard deviations, each with the mean of the variance that it may
// stand for. None is taken for more than 30 times what `stated` states, either
// way. Nothing where all that is a difference of less than 5 %.
std::optional<Rig> Reweight(const Rig& stated,
                            const Rig& taken,
                            const std::vector<NoiseFactor>& factors);

// The largest NoiseFactor::used, at least 1, of all kinds but the walks, which
// are hardly ever determined and matter least; pixels are noisier by
// `track_noise` besides.
double LargestNoise(const std::vector<NoiseFactor>& factors,
                    double track_noise);

}  // namespace selfcal
