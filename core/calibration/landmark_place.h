// The place of one landmark in the scene of all keyframes, and how it is
// improved while keyframes and calibration are held.
//
// Pure, any thread.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "core/calibration/problem.h"
#include "core/calibration/robust_loss.h"
#include "core/factor/keyframe_motion.h"
#include "core/factor/landmark_anchor.h"
#include "core/model/calibration.h"
#include "core/model/segment.h"

namespace selfcal {

// Standard deviation [1/m] of a prior on every landmark's inverse depth,
// centred at infinity: nothing is seen from much nearer than 0.1 m. It is far
// too weak to move what has any parallax, and keeps a landmark that loses its
// parallax within a round, as that of a device at rest, from running away.
inline constexpr double kInverseDepthSigma = 10;

// A landmark lies in front of the cameras that see it: its inverse depth is
// held to more than so many of its own standard deviations below that of
// infinity. Noise takes one that is far away a little below; a whole scene
// beyond infinity is the mirror image of the true one, which fits the pixels
// of a camera that turns about a point as well, with its lever arm reversed.
inline constexpr double kMaxBeyondInfinity = 2;

// No camera sees a point that is nearer to its centre.
inline constexpr double kMinDistance_m = 0.01;

// What landmarks are measured against: every camera at every keyframe.
class LandmarkScene {
 public:
  // theta must outlive the scene.
  LandmarkScene(const Calibration& theta,
                std::span<const KeyframeState> keyframes,
                const KeyframeMotions& motions,
                double pixel_sigma_px);

  double pixel_sigma_px() const { return pixel_sigma_px_; }
  const CameraCalibration& camera(const TrackObservation& seen) const {
    return theta_.cameras[seen.camera];
  }
  // Of the camera that saw it: rotation from G, and where the origin of G is.
  const Eigen::Matrix3d& R_CG(const TrackObservation& seen) const {
    return views_[Index(seen)].R_CG;
  }
  const Eigen::Vector3d& p_CG(const TrackObservation& seen) const {
    return views_[Index(seen)].p_CG;
  }

  // Predicted minus measured [px] of a homogeneous point in G; by_p_C, unless
  // null, its derivative by p_C = R_CG X + w p_CG. False, leaving both
  // untouched, where the point does not project, or lies nearer than
  // kMinDistance_m: in the centre of a camera any pixel fits.
  bool Residual(const TrackObservation& seen,
                const Eigen::Vector4d& point_G,
                Eigen::Vector2d* residual_px,
                Eigen::Matrix<double, 2, 3>* by_p_C) const;

 private:
  struct View {
    Eigen::Matrix3d R_CG;
    Eigen::Vector3d p_CG;
  };

  std::size_t Index(const TrackObservation& seen) const {
    return seen.keyframe * theta_.cameras.size() + seen.camera;
  }

  const Calibration& theta_;
  double pixel_sigma_px_;
  std::vector<View> views_;  // keyframe by keyframe
};

// A landmark by inverse depth from the camera that saw it first, with the axis
// of depth pointing at it.
struct LandmarkPlace {
  LandmarkAnchor anchor;
  Eigen::Vector3d inverse_depth = Eigen::Vector3d::Zero();

  Eigen::Vector4d Homogeneous() const {
    return anchor.ToHomogeneous(inverse_depth);
  }
  // In G [m]; one further away than 10 km at that depth, which is as good as
  // infinity.
  Eigen::Vector3d Point() const;

  // Goes a linear step in (alpha, beta, rho): as a point in space where the
  // step is small against its depth, so that it slides along with the
  // keyframes that see it; else by inverse depth, to which infinity is
  // harmless.
  void Move(const Eigen::Vector3d& step);
};

// The place of a homogeneous point in G, anchored at the track's first camera.
LandmarkPlace PlaceAt(const LandmarkScene& scene,
                      const Track& track,
                      const Eigen::Vector4d& point_G);

// One of a track that a place stands on.
struct UsedObservation {
  int index = 0;      // into the track
  double weight = 1;  // in (0, 1]
};

// When to stop improving a place.
struct RefineLimits {
  int steps = 30;
  // What the next step would take off the cost [sigma^2]: far below a sigma of
  // the place it changes nothing that is measured.
  double decrease = 1e-8;
};

struct RefinedPlace {
  Eigen::Matrix3d information;  // of (alpha, beta, rho)
  double cost = 0;  // sum of the loss and of the prior on inverse depth
  // The minimum lies further beyond infinity than is allowed; the place is the
  // best one that is.
  bool behind = false;
};

// What an observation that does not project counts for [sigma]: as one beyond
// any gate.
inline constexpr double kNotProjectedSigmas = 1e3;

// Minimises the robust reprojection cost of the observations `used`, and the
// prior on inverse depth, by damped Gauss-Newton, where the landmark is in
// front of the camera that it is anchored to. From a place behind it, the
// search starts at infinity.
RefinedPlace RefinePlace(const LandmarkScene& scene,
                         const Track& track,
                         std::span<const UsedObservation> used,
                         const RobustLoss& loss,
                         const RefineLimits& limits,
                         LandmarkPlace* place);

// Every observation of the track, in full.
std::vector<UsedObservation> AllOf(const Track& track);

// Norm of each residual [px]; infinite where the place does not project.
std::vector<double> ResidualNorms(const LandmarkScene& scene,
                                  const Track& track,
                                  const Eigen::Vector4d& point_G);

}  // namespace selfcal
