// The robust loss on reprojection residuals, as weights; the solver applies the
// same loss by Ceres' own classes.
#pragma once

#include <cmath>

#include "core/calibration/calibrate.h"

namespace selfcal {

// rho'(s) of a squared norm s [sigma^2]: the weight of a residual in the normal
// equations. Huber: sqrt(s) up to `scale` counts fully. Cauchy:
// rho = scale^2 log(1 + s / scale^2).
inline double LossWeight(LossKind kind, double scale, double s) {
  switch (kind) {
    case LossKind::kHuber:
      return s <= scale * scale ? 1.0 : scale / std::sqrt(s);
    case LossKind::kCauchy:
      return 1.0 / (1.0 + s / (scale * scale));
    case LossKind::kNone:
      break;
  }
  return 1.0;
}

// rho(s), for comparing two places of one landmark.
inline double LossValue(LossKind kind, double scale, double s) {
  switch (kind) {
    case LossKind::kHuber:
      return s <= scale * scale ? s : 2 * scale * std::sqrt(s) - scale * scale;
    case LossKind::kCauchy:
      return scale * scale * std::log1p(s / (scale * scale));
    case LossKind::kNone:
      break;
  }
  return s;
}

}  // namespace selfcal
