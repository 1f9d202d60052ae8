// Compares two calibrations on the same segments by different solvers. Pure,
// callable from any thread.
#pragma once

#include <string>

#include "core/calibration/calibrate.h"
#include "core/model/rig.h"

namespace selfcal {

struct ResultDifference {
  // Reason why the two cannot be compared: one has not converged, or they
  // exclude different segments or hold different directions constant (if a
  // threshold lies between them, either is correct). Empty if they can be
  // compared; otherwise nothing else is set.
  std::string incomparable;
  // Difference of the component that differs most, in standard deviations.
  double theta_sigmas = 0;
  std::string theta_component;
  // Largest relative difference of the standard deviations of a component.
  double sigma = 0;
  std::string sigma_component;
  // The same over all directions of theta: of the covariance as a whole.
  double covariance = 0;
};

ResultDifference CompareResults(const Rig& rig,
                                const CalibrationResult& a,
                                const CalibrationResult& b);

// A solver has converged if the remaining step is below 0.05 sigma in each
// component: two converged ones are within 0.1 of each other.
inline constexpr double kThetaTolerance_sigmas = 0.1;
// Tolerance of standard deviations: outliers are determined at an estimate, and
// that differs by up to kThetaTolerance_sigmas.
inline constexpr double kSigmaTolerance = 0.02;

// Returns true if convergence tolerances explain the difference, and also if
// the two cannot be compared: that proves nothing.
bool IsConvergence(const ResultDifference& difference);

}  // namespace selfcal
