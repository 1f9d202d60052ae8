// Rates of a rotation Exp(phi(t)). Internal to core/simulation.
#pragma once

#include <Eigen/Core>

#include "core/simulation/sine_sum.h"

namespace selfcal {

// Angular rate and acceleration in the frame of the body.
struct RotationRates {
  Eigen::Vector3d w, dw;
};

RotationRates RatesOf(const Curve& phi);

}  // namespace selfcal
