// Random numbers with the same bits for the same seed on every standard
// library: the C++ standard specifies the engine, but not its distributions, so
// the few that the simulation needs are implemented here.
//
// Each purpose has a separate stream: more landmarks do not change the noise of
// the IMU.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <random>

namespace selfcal {

class Random {
 public:
  Random(std::uint64_t seed, std::uint64_t stream);

  // Uniform numbers in [0, 1), and in [low, high).
  double Uniform();
  double Uniform(double low, double high);
  // Uniform index in [0, size); size > 0.
  std::size_t Index(std::size_t size);
  // True with the given probability.
  bool Chance(double probability);
  // 1 or -1.
  double Sign();
  // Standard normal (Box and Muller 1958).
  double Normal();
  Eigen::Vector3d Normal3();
  // Gamma distribution of unit scale, shape > 0 (Marsaglia and Tsang 2000).
  double Gamma(double shape);
  // Uniform on the unit sphere.
  Eigen::Vector3d Direction();

 private:
  std::mt19937_64 engine_;
  double spare_ = 0;  // the second value of a Box-Muller pair
  bool has_spare_ = false;
};

}  // namespace selfcal
