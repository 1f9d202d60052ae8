#include "core/simulation/random.h"

#include <cmath>
#include <numbers>

namespace selfcal {
namespace {

// One step of splitmix64: seeds that differ in one bit give unrelated engines.
std::uint64_t Mix(std::uint64_t x) {
  x += 0x9e3779b97f4a7c15ULL;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ULL;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebULL;
  return x ^ (x >> 31);
}

}  // namespace

Random::Random(std::uint64_t seed, std::uint64_t stream)
    : engine_(Mix(Mix(seed) ^ stream)) {}

double Random::Uniform() {
  return static_cast<double>(engine_() >> 11) * 0x1.0p-53;
}

double Random::Uniform(double low, double high) {
  return low + (high - low) * Uniform();
}

std::size_t Random::Index(std::size_t size) {
  return static_cast<std::size_t>(engine_() % size);
}

bool Random::Chance(double probability) { return Uniform() < probability; }

double Random::Sign() { return Chance(0.5) ? 1 : -1; }

double Random::Normal() {
  if (has_spare_) {
    has_spare_ = false;
    return spare_;
  }
  // 1 - u lies in (0, 1]: its logarithm is finite.
  const double radius = std::sqrt(-2 * std::log(1 - Uniform()));
  const double angle = 2 * std::numbers::pi * Uniform();
  spare_ = radius * std::sin(angle);
  has_spare_ = true;
  return radius * std::cos(angle);
}

Eigen::Vector3d Random::Normal3() {
  const double x = Normal();
  const double y = Normal();
  const double z = Normal();
  return {x, y, z};
}

double Random::Gamma(double shape) {
  if (shape < 1) {
    // 1 - u lies in (0, 1].
    return Gamma(shape + 1) * std::pow(1 - Uniform(), 1 / shape);
  }
  const double d = shape - 1.0 / 3;
  const double c = 1 / std::sqrt(9 * d);
  for (;;) {
    const double x = Normal();
    const double v = std::pow(1 + c * x, 3);
    const double log_u = std::log(1 - Uniform());
    if (v > 0 && log_u < 0.5 * x * x + d * (1 - v + std::log(v))) return d * v;
  }
}

Eigen::Vector3d Random::Direction() {
  const double z = Uniform(-1, 1);
  const double angle = Uniform(0, 2 * std::numbers::pi);
  const double radius = std::sqrt(1 - z * z);
  return {radius * std::cos(angle), radius * std::sin(angle), z};
}

}  // namespace selfcal
