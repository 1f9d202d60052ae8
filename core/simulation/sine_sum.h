// Sums of sines with exact derivatives, for analytic motions.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <numbers>
#include <vector>

#include "core/simulation/random.h"

namespace selfcal {

// A vector over time with its first two derivatives.
struct Curve {
  Eigen::Array3d x = Eigen::Array3d::Zero();
  Eigen::Array3d d1 = Eigen::Array3d::Zero();
  Eigen::Array3d d2 = Eigen::Array3d::Zero();
};

// Sum of one sine for each axis and term.
class SineSum {
 public:
  // Adds a sine on each axis: frequencies drawn from a band [Hz], random
  // phases. amplitude(axis, omega) gives the amplitude for a frequency [rad/s].
  template <typename Amplitude>
  void Add(double low_hz, double high_hz, Amplitude amplitude, Random* random) {
    constexpr double kTwoPi = 2 * std::numbers::pi;
    Term term;
    for (int axis = 0; axis < 3; ++axis) {
      term.omega[axis] = kTwoPi * random->Uniform(low_hz, high_hz);
      term.phase[axis] = random->Uniform(0, kTwoPi);
      term.amplitude[axis] = amplitude(axis, term.omega[axis]);
    }
    terms_.push_back(term);
  }

  Curve At(double t) const {
    Curve sum;
    for (const Term& term : terms_) {
      const Eigen::Array3d angle = term.omega * t + term.phase;
      const Eigen::Array3d sine = term.amplitude * angle.sin();
      sum.x += sine;
      sum.d1 += term.amplitude * term.omega * angle.cos();
      sum.d2 -= term.omega.square() * sine;
    }
    return sum;
  }

 private:
  struct Term {
    Eigen::Array3d amplitude, omega, phase;
  };
  std::vector<Term> terms_;
};

}  // namespace selfcal
