// One match of an epipolar fit: its distance from the epipolar plane, and the
// derivatives of that. Internal to core/initialisation.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace selfcal {

// Gauss-Newton derivatives: those of the length of the plane's normal, which
// multiply the residual, are left out.
struct EpipolarRow {
  double r;                      // [px]
  double to_px;                  // [px] for a change of t . (c x b)
  Eigen::Vector3d by_rotation;   // of R_BA, perturbed on the left [px/rad]
  Eigen::Vector3d by_direction;  // of t; only what is across t counts [px/rad]
};

// `c` is the ray R_BA a. False for a point in the direction of the translation,
// which has no epipolar plane.
inline bool MakeEpipolarRow(const Eigen::Vector3d& t_B,
                            const Eigen::Vector3d& c,
                            const Eigen::Vector3d& b,
                            double px_per_rad,
                            EpipolarRow* row) {
  const Eigen::Vector3d normal = t_B.cross(c);
  const double length = normal.norm();
  if (length < 1e-3) return false;
  row->to_px = px_per_rad / length;
  row->r = row->to_px * b.dot(normal);
  row->by_rotation = row->to_px * (t_B.dot(c) * b - b.dot(c) * t_B);
  row->by_direction = row->to_px * c.cross(b);
  return true;
}

}  // namespace selfcal
