#include "core/calibration/noise_scale.h"

#include <algorithm>
#include <cmath>

namespace selfcal {
namespace {

// Noise scales are limited to this: beyond it, something else is wrong.
constexpr double kMostOff = 30;
// Trackers err by some hundredths of a pixel in ways that depend on the place
// in the image and on the motion, since they interpolate: these errors do not
// average out over tracks, so that theta is not more certain than with
// independent errors of this size.
constexpr double kLeastPixelNoise_px = 0.05;
// A scale that is not determined is still nearer to the truth if it exceeds one
// by more than this many standard deviations.
constexpr double kOffSigmas = 1;
// Upper limit of the variance of a logarithm.
constexpr double kMostUncertain = 0.5;
// Smallest relevant change of the logarithm of a noise scale.
constexpr double kLeastChange = 0.05;

// A reference into a Rig or a const Rig.
template <typename AnyRig>
auto& Noise(NoiseKind kind, AnyRig& rig) {
  if (kind == NoiseKind::kPixel) return rig.pixel_sigma_px;
  auto& noise = ImuOf(kind) == 0 ? rig.imu_noise : rig.imu1_noise;
  switch (OfFirstImu(kind)) {
    case NoiseKind::kGyro:
      return noise.gyro_noise_density;
    case NoiseKind::kAccel:
      return noise.accel_noise_density;
    case NoiseKind::kGyroBiasWalk:
      return noise.gyro_bias_random_walk;
    default:
      return noise.accel_bias_random_walk;
  }
}

double LeastNoise(NoiseKind kind, const Rig& stated) {
  const double noise = NoiseOf(kind, stated);
  const double least = noise / kMostOff;
  if (kind != NoiseKind::kPixel) return least;
  return std::max(least, std::min(noise, kLeastPixelNoise_px));
}

}  // namespace

std::string NoiseKindName(NoiseKind kind) {
  if (kind == NoiseKind::kPixel) return "pixel";
  if (ImuOf(kind) > 0) return "imu1_" + NoiseKindName(OfFirstImu(kind));
  switch (kind) {
    case NoiseKind::kGyro:
      return "gyro";
    case NoiseKind::kAccel:
      return "accel";
    case NoiseKind::kGyroBiasWalk:
      return "gyro_bias_walk";
    default:
      return "accel_bias_walk";
  }
}

std::optional<NoiseKind> FindNoiseKind(const std::string& name) {
  for (int i = 0; i < kMaxNoiseKinds; ++i) {
    const auto kind = static_cast<NoiseKind>(i);
    if (NoiseKindName(kind) == name) return kind;
  }
  return std::nullopt;
}

double NoiseOf(NoiseKind kind, const Rig& rig) { return Noise(kind, rig); }

void ScaleNoise(NoiseKind kind, double factor, Rig* rig) {
  Noise(kind, *rig) *= factor;
}

std::optional<Rig> Reweight(const Rig& stated,
                            const Rig& taken,
                            const std::vector<NoiseScale>& scales) {
  Rig next = taken;
  double change = 0;
  for (const NoiseScale& scale : scales) {
    // Overestimated noise does no harm; underestimated noise makes a
    // calibration overconfident.
    if (!scale.determined() &&
        std::log(scale.factor) < kOffSigmas * scale.log_sigma) {
      continue;
    }
    const double before = NoiseOf(scale.kind, taken);
    const double most = kMostOff * NoiseOf(scale.kind, stated);
    // Expected variance, which is the relevant quantity, given the uncertainty
    // of the scale.
    const double uncertain =
        std::exp(std::min(scale.log_sigma * scale.log_sigma, kMostUncertain));
    const double after = std::clamp(scale.factor * uncertain * before,
                                    LeastNoise(scale.kind, stated),
                                    most);
    ScaleNoise(scale.kind, after / before, &next);
    change = std::max(change, std::abs(std::log(after / before)));
  }
  if (change < kLeastChange) return std::nullopt;
  return next;
}

double LargestNoise(const std::vector<NoiseScale>& scales, double track_noise) {
  double largest = 1;
  for (const NoiseScale& scale : scales) {
    const bool pixel = scale.kind == NoiseKind::kPixel;
    if (!pixel && (OfFirstImu(scale.kind) == NoiseKind::kGyroBiasWalk ||
                   OfFirstImu(scale.kind) == NoiseKind::kAccelBiasWalk)) {
      continue;
    }
    const double tracks = pixel ? track_noise : 1;
    largest = std::max(largest, scale.used * tracks);
  }
  return largest;
}

}  // namespace selfcal
