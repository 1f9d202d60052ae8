#include "test/rendering/sensor.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace selfcal {
namespace {

constexpr int kQuantileBits = 12;
constexpr int kQuantiles = 1 << kQuantileBits;
constexpr int kPixelsPerHash = 64 / kQuantileBits;

// Finaliser of splitmix64 (Steele, Lea and Flood 2014).
std::uint64_t Hash(std::uint64_t x) {
  x += 0x9e3779b97f4a7c15ULL;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ULL;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebULL;
  return x ^ (x >> 31);
}

// Inverse of the standard normal distribution function, by bisection.
double NormalQuantile(double p) {
  double low = -10;
  double high = 10;
  for (int i = 0; i < 60; ++i) {
    const double middle = (low + high) / 2;
    const bool below = 0.5 * std::erfc(-middle * std::numbers::sqrt2 / 2) < p;
    (below ? low : high) = middle;
  }
  return low;
}

using Quantiles = std::array<float, kQuantiles>;

// Equally probable values of mean 0 and variance 1, nearly normal.
Quantiles MakeQuantiles() {
  Quantiles values;
  double squares = 0;
  for (int i = 0; i < kQuantiles; ++i) {
    const double value = NormalQuantile((i + 0.5) / kQuantiles);
    values[static_cast<std::size_t>(i)] = static_cast<float>(value);
    squares += value * value;
  }
  const double to_unit = std::sqrt(kQuantiles / squares);
  for (float& value : values) value *= static_cast<float>(to_unit);
  return values;
}

// Distance of the farthest corner from the principal point [px].
double FarthestCorner(const CameraCalibration& camera) {
  const double x = std::max(camera.c.x(), camera.width_px - 1 - camera.c.x());
  const double y = std::max(camera.c.y(), camera.height_px - 1 - camera.c.y());
  return std::hypot(x, y);
}

}  // namespace

double GainAt(const SensorOptions& options, double t_s) {
  return std::exp(options.gain_amplitude *
                  std::sin(2 * std::numbers::pi * t_s / options.gain_period_s));
}

double Vignetting(const CameraCalibration& camera,
                  const SensorOptions& options,
                  const Eigen::Vector2d& z_px) {
  const double share = (z_px - camera.c).norm() / FarthestCorner(camera);
  return 1 - options.vignetting * share * share;
}

GreyImage ReadOut(const CameraCalibration& camera,
                  const SensorOptions& options,
                  double gain,
                  const ImageSeed& seed,
                  const std::vector<float>& radiance) {
  static const Quantiles quantiles = MakeQuantiles();
  GreyImage image{camera.width_px, camera.height_px, {}};
  image.pixels.resize(radiance.size());
  const auto stream =
      Hash(Hash(seed.seed) ^ (static_cast<std::uint64_t>(seed.camera) << 40) ^
           static_cast<std::uint64_t>(seed.image));
  const double corner = FarthestCorner(camera);
  const auto fall = static_cast<float>(options.vignetting / (corner * corner));
  const auto full = static_cast<float>(options.full_well_e);
  const auto read =
      static_cast<float>(options.read_noise_e * options.read_noise_e);
  const auto to_grey = static_cast<float>(gain * 255 / options.full_well_e);
  std::uint64_t hash = 0;
  std::size_t i = 0;
  for (int v = 0; v < camera.height_px; ++v) {
    const float dy = static_cast<float>(v - camera.c.y());
    for (int u = 0; u < camera.width_px; ++u, ++i) {
      const float dx = static_cast<float>(u - camera.c.x());
      const float share = 1 - fall * (dx * dx + dy * dy);
      float electrons = full * share * radiance[i];
      if (options.noise) {
        const auto part = static_cast<int>(i % kPixelsPerHash);
        if (part == 0) hash = Hash(stream + i);
        const auto index = static_cast<std::size_t>(
            (hash >> (part * kQuantileBits)) & (kQuantiles - 1));
        electrons += std::sqrt(electrons + read) * quantiles[index];
      }
      const float grey = std::clamp(electrons * to_grey, 0.0F, 255.0F);
      image.pixels[i] = static_cast<std::uint8_t>(grey + 0.5F);
    }
  }
  return image;
}

}  // namespace selfcal
