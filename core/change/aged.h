// A calibration grows old: the device warms up, wears and is knocked about a
// little, so that its parameters walk at random from where they were when they
// were measured. Pure, any thread.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "core/model/rig.h"

namespace selfcal {

// The density of the random walk of all components that match a pattern, as
// for ParameterGroup; 0: they never change.
struct WalkDensity {
  std::string pattern;
  double density = 0;  // [unit/sqrt(day)]

  friend bool operator==(const WalkDensity&, const WalkDensity&) = default;
};

// Of every tangent component; later ones win. Without one a hundredth of
// sigma_ref. Age alone then makes uncertain, after a month, a twentieth of what
// one reference segment leaves so, which a good calibration feels, and a fifth
// after a year: focal lengths 0.3 px, rotations of cameras 1 mrad, scales of
// the gyroscope 0.1 %. That is chosen, not measured.
Eigen::VectorXd WalkDensities(const Rig& rig,
                              const std::vector<WalkDensity>& walks);

// Patterns that match nothing and densities that are no number of at least 0,
// with paths that begin with "walk_densities". At most 1024 are looked at.
std::vector<Violation> Validate(const Rig& rig,
                                const std::vector<WalkDensity>& walks);

// The covariance of an estimate (D x D) a number of days after the segments
// that it came from: q^2 more variance a day for each component that the rig
// estimates, q its density (D). Components walk independently. Before that time
// (days < 0) it is what it was.
Eigen::MatrixXd AgedCovariance(const Rig& rig,
                               const Eigen::VectorXd& densities,
                               const Eigen::MatrixXd& covariance,
                               double days);

inline constexpr double kNanosecondsOfDay = 86'400e9;

}  // namespace selfcal
