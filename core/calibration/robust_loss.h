// Robust loss on reprojection residuals, shared by the solver, the landmarks
// and the covariance.
#pragma once

#include <limits>

#include "core/calibration/calibrate.h"

namespace selfcal {

// A loss rho(s) of a squared norm s [sigma^2], with rho(s) = s for small s.
//   Huber:  weight rho'(s) = min(1, scale / sqrt(s));
//   Cauchy: weight 1 / (1 + s / scale^2).
// From 0.6 of the gate on, the weight decreases linearly in s to zero at the
// gate, and rho is constant beyond. An observation at the gate thus has no
// influence, and it makes no difference whether it is treated as within or
// beyond: otherwise single observations near the gate would decide between
// optima a tenth of a sigma apart, each consistent with itself. The gate must
// be at least twice the scale.
struct RobustLoss {
  LossKind kind = LossKind::kHuber;
  double scale = 2.0;                                     // [sigma]
  double gate = std::numeric_limits<double>::infinity();  // [sigma]

  double Weight(double s) const;
  // d(s Weight(s)) / ds: the derivative of the gradient with respect to the
  // residual, averaged over its direction in the plane. Equal to Weight(s) for
  // small s.
  double Curvature(double s) const;
  // rho(s) [sigma^2].
  double Value(double s) const;
};

}  // namespace selfcal
