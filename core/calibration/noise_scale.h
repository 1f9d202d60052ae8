// Noise scales: the noise of a rig according to residuals, relative to the
// noise that the rig states.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/model/rig.h"

namespace selfcal {

// Kinds of noise, in the order of NoiseScales. The last four are those of a
// second IMU, in the order of the first one's.
enum class NoiseKind {
  kPixel,
  kGyro,
  kAccel,
  kGyroBiasWalk,
  kAccelBiasWalk,
  kSecondGyro,
  kSecondAccel,
  kSecondGyroBiasWalk,
  kSecondAccelBiasWalk,
};
inline constexpr int kNoiseKinds = 5;  // of a rig with one IMU
inline constexpr int kNoiseKindsOfImu = kNoiseKinds - 1;
inline constexpr int kMaxNoiseKinds = kNoiseKinds + kNoiseKindsOfImu;

constexpr int IndexOf(NoiseKind kind) { return static_cast<int>(kind); }
// The same kind of noise of an IMU; `kind` is that of the first.
constexpr NoiseKind OfImu(NoiseKind kind, int imu) {
  return static_cast<NoiseKind>(IndexOf(kind) + imu * kNoiseKindsOfImu);
}
// The IMU whose noise this is, and the kind for the first; not of pixels.
constexpr int ImuOf(NoiseKind kind) {
  return (IndexOf(kind) - 1) / kNoiseKindsOfImu;
}
constexpr NoiseKind OfFirstImu(NoiseKind kind) {
  return OfImu(kind, -ImuOf(kind));
}

// A noise scale is determined if the standard deviation of its logarithm is
// below this: two of them are then 20 %.
inline constexpr double kDeterminedLogSigma = 0.1;

// Ratio of the actual noise of one kind to the noise that the rig states.
struct NoiseScale {
  NoiseKind kind = NoiseKind::kPixel;
  double factor = 1;
  double log_sigma = 0;  // standard deviation of the logarithm of the factor
  // Number of residuals of this kind, whitened, not absorbed by unknowns.
  double redundancy = 0;
  // Ratio of the noise by which the calibration was weighted to the noise that
  // the rig states.
  double used = 1;
  // The estimate of the scales converged; else `factor` is the last iterate.
  bool converged = true;

  bool determined() const { return log_sigma < kDeterminedLogSigma; }
};

// "pixel", "gyro", "accel", "gyro_bias_walk", "accel_bias_walk", and those with
// "imu1_" before them.
std::string NoiseKindName(NoiseKind kind);
std::optional<NoiseKind> FindNoiseKind(const std::string& name);

// Noise of a kind as a rig states it, in the unit of the rig.
double NoiseOf(NoiseKind kind, const Rig& rig);
void ScaleNoise(NoiseKind kind, double factor, Rig* rig);

// Returns the rig with the noise that `scales`, which are relative to the
// noise of `taken`, suggest. It applies those that are determined, or larger
// than one by more than one of their standard deviations, each with the
// expected variance, given the uncertainty of the scale. The noise of any kind
// stays within a factor of 30 of `stated`, in both directions, and that of
// pixels above 0.05 px unless `stated` is less. Returns nullopt if the
// difference is less than 5 % for all kinds.
std::optional<Rig> Reweight(const Rig& stated,
                            const Rig& taken,
                            const std::vector<NoiseScale>& scales);

// Returns the largest NoiseScale::used, at least 1, over all kinds but the
// walks, which are rarely determined and matter least; `track_noise`
// additionally scales the noise of pixels.
double LargestNoise(const std::vector<NoiseScale>& scales, double track_noise);

}  // namespace selfcal
