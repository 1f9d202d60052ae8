// The place of one landmark from its observations alone, with keyframes and
// calibration held: a function of the present estimate and of nothing that went
// before, so that two ways to one estimate see the same landmarks.
//
// Pure, any thread.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "core/calibration/problem.h"
#include "core/calibration/robust_loss.h"
#include "core/factor/ceres_factors.h"
#include "core/model/calibration.h"
#include "core/model/segment.h"

namespace selfcal {

// Standard deviation [1/m] of a prior on every landmark's inverse depth,
// centred at infinity: nothing is seen from much nearer than 0.1 m. It is far
// too weak to move what has any parallax, and keeps a landmark that loses its
// parallax within a round, as that of a device at rest, from running away.
inline constexpr double kInverseDepthSigma = 10;

// What landmarks are measured against.
struct LandmarkScene {
  const Calibration& theta;
  std::span<const KeyframeState> keyframes;
  double pixel_sigma_px;
};

// A landmark by inverse depth from the camera that saw it first, with the axis
// of depth pointing at it.
struct LandmarkPlace {
  LandmarkAnchor anchor;
  Eigen::Vector3d inverse_depth = Eigen::Vector3d::Zero();

  Eigen::Vector4d Homogeneous() const {
    return anchor.ToHomogeneous(inverse_depth);
  }
};

// A place found by least median of squares over pairs of rays, so that nearly
// half of the observations may be wrong, then refined with a loss that gives
// gross errors no weight. Nothing if no pair of rays gives a point in front of
// the cameras.
std::optional<LandmarkPlace> TriangulateTrack(const LandmarkScene& scene,
                                              const Track& track);

// Minimises the robust reprojection cost of the observations `used` (indices
// into the track), and the prior on inverse depth, by damped Gauss-Newton.
// Returns the information matrix of (alpha, beta, rho) at the end.
Eigen::Matrix3d RefinePlace(const LandmarkScene& scene,
                            const Track& track,
                            std::span<const int> used,
                            const RobustLoss& loss,
                            LandmarkPlace* place);

// Norm of each residual [px]; infinite where the place does not project.
std::vector<double> ResidualNorms(const LandmarkScene& scene,
                                  const Track& track,
                                  const Eigen::Vector4d& landmark_G);

}  // namespace selfcal
