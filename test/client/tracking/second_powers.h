#pragma once

#include <Eigen/Core>

namespace selfcal::client {

// x^2, xy and y^2.
inline Eigen::Vector3d SecondPowers(const Eigen::Vector2d& x) {
  return {x.x() * x.x(), x.x() * x.y(), x.y() * x.y()};
}

}  // namespace selfcal::client
