// Ageing of a calibration: the device warms up, wears and suffers small knocks,
// so that its parameters random-walk away from their measured values. Pure,
// callable from any thread.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "core/model/rig.h"

namespace selfcal {

// Density of the random walk of all components that match a pattern, with
// patterns as in ParameterGroup; 0: they never change.
struct WalkDensity {
  std::string pattern;
  double density = 0;  // [unit/sqrt(day)]

  friend bool operator==(const WalkDensity&, const WalkDensity&) = default;
};

// Density of every tangent component; later ones take precedence. The default
// is a hundredth of sigma_ref. With it, age alone adds an uncertainty of a
// twentieth of that after one reference segment in a month, which is noticeable
// for a good calibration, and of a fifth in a year: focal lengths 0.3 px,
// rotations of cameras 1 mrad, scales of the gyroscope 0.1 %. The default is
// chosen, not measured.
Eigen::VectorXd WalkDensities(const Rig& rig,
                              const std::vector<WalkDensity>& walks);

// Reports patterns that match nothing and densities outside [0, 1e6], with
// paths that begin with "walk_densities". It checks at most kMaxPatterns.
std::vector<Violation> Validate(const Rig& rig,
                                const std::vector<WalkDensity>& walks);

// Covariance of an estimate (D x D) a number of days after the segments on
// which it is based: for each component that the rig estimates, the variance
// increases by q^2 per day, with its density q (D). Components walk
// independently. For days < 0 the covariance is unchanged.
Eigen::MatrixXd AgedCovariance(const Rig& rig,
                               const Eigen::VectorXd& densities,
                               const Eigen::MatrixXd& covariance,
                               double days);

inline constexpr double kNanosecondsOfDay = 86'400e9;

}  // namespace selfcal
