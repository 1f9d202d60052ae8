// By what two calibrations on the same segments differ that two solvers have
// found. Pure, any thread.
#pragma once

#include <string>

#include "core/calibration/calibrate.h"
#include "core/model/rig.h"

namespace selfcal {

struct ResultDifference {
  // Why the two cannot be compared: one has not converged, or they leave out
  // different segments or hold different directions constant (where a threshold
  // lies between them, either is right). Empty if they can; otherwise nothing
  // else is set.
  std::string incomparable;
  // Of the component that differs most, in standard deviations.
  double theta_sigmas = 0;
  std::string theta_component;
  // By which part the standard deviations of a component differ most.
  double sigma = 0;
  std::string sigma_component;
  // The same of any direction of theta together: of the covariance as a whole.
  double covariance = 0;
};

ResultDifference CompareResults(const Rig& rig,
                                const CalibrationResult& a,
                                const CalibrationResult& b);

// A solver has converged where the step that is left is below 0.05 sigma in
// each component: two that have lie within 0.1 of each other.
inline constexpr double kThetaTolerance_sigmas = 0.1;
// Of standard deviations: which observations are outliers is decided at an
// estimate, and that differs by so much.
inline constexpr double kSigmaTolerance = 0.02;

// Whether where solvers stop explains the difference. Also where the two cannot
// be compared: that proves nothing.
bool IsConvergence(const ResultDifference& difference);

}  // namespace selfcal
