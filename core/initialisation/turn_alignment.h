// The rotation of a camera in the body, its time offset and the bias of the
// gyroscope, roughly: those for which the rotations that its images show are
// the ones of the gyroscope. Internal to core/initialisation.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <optional>
#include <vector>

#include "core/initialisation/gyro_rotation.h"
#include "core/initialisation/visual_turn.h"

namespace selfcal {

struct TurnAlignment {
  Eigen::Quaterniond q_CI = Eigen::Quaterniond::Identity();
  double offset_s = 0;
  Eigen::Vector3d b_g = Eigen::Vector3d::Zero();  // mean, in I [rad/s]
  // Share of the truncated squares of the camera's rotations about their mean
  // rate that is left: 0 perfect, 1 as if nothing agreed.
  double share = 1;
  int turns = 0;  // that the samples cover
  // Root mean square of the gyroscope's rate about its mean: on all axes, and
  // on all but the one with most of it [rad/s].
  double speed_radps = 0;
  double other_axes_radps = 0;
  // Ratio of the camera's rotations across its axis to the gyroscope's: that of
  // the true focal length to the one of the rays.
  double focal_ratio = 1;
  // Largest standard deviation of q_CI on an axis, from the residuals [rad].
  double rotation_sigma_rad = 0;
};

// Aligns the turns at one offset, with any rotation or a given one. `gyro` is
// without a bias.
TurnAlignment AlignTurns(const std::vector<VisualTurn>& turns,
                         const GyroRotation& gyro,
                         double first_s,  // of the samples
                         double last_s,
                         double offset_s,
                         const std::optional<Eigen::Quaterniond>& q_CI);

// The offsets at which the share is least, least first: one for each local
// minimum over a range that is somewhat larger than the given one. The best one
// may lie at an end of it. Offsets at which the samples cover few of the turns
// are no minima.
std::vector<TurnAlignment> SearchOffsets(
    const std::vector<VisualTurn>& turns,
    const GyroRotation& gyro,
    double first_s,
    double last_s,
    double centre_s,
    double range_s,
    const std::optional<Eigen::Quaterniond>& q_CI);

}  // namespace selfcal
