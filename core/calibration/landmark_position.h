// The position of one landmark relative to all keyframes, and its refinement
// while keyframes and calibration are held constant.
//
// Pure, callable from any thread.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "core/calibration/chain_thetas.h"
#include "core/calibration/problem.h"
#include "core/calibration/robust_loss.h"
#include "core/factor/keyframe_motion.h"
#include "core/factor/landmark_anchor.h"
#include "core/model/calibration.h"
#include "core/model/segment.h"

namespace selfcal {

// Standard deviation [1/m] of a prior on every landmark's inverse depth,
// centred at infinity: nothing is observed from much nearer than 0.1 m. The
// prior is far too weak to move a landmark with any parallax; it keeps a
// landmark that loses its parallax within a round, as those of a device at
// rest, from diverging.
inline constexpr double kInverseDepthSigma = 10;

// A landmark lies in front of the cameras that observe it: its inverse depth
// may be at most this many of its own standard deviations beyond infinity, that
// is below zero. Noise moves a distant landmark slightly beyond infinity; a
// whole scene beyond infinity is the mirror image of the true one, which fits
// the pixels of a camera that rotates about a point equally well, with its
// lever arm reversed.
inline constexpr double kMaxBeyondInfinity = 2;

// A camera cannot observe a point that is nearer to its centre.
inline constexpr double kMinDistance_m = 0.01;

// A camera at an exposure: p_C = R_CG p_G + p_CG.
struct CameraPose {
  Eigen::Matrix3d R_CG;
  Eigen::Vector3d p_CG;  // origin of G in C
};

// The poses of every camera at every keyframe.
class LandmarkScene {
 public:
  // Keyframes and motions must outlive the scene.
  LandmarkScene(ChainThetas thetas,
                std::span<const KeyframeState> keyframes,
                const KeyframeMotions& motions,
                double pixel_sigma_px);

  double pixel_sigma_px() const { return pixel_sigma_px_; }
  const CameraCalibration& camera(const TrackObservation& seen) const {
    return thetas_.OfKeyframe(seen.keyframe).cameras[seen.camera];
  }
  // The camera of an observation when its pixel was exposed.
  CameraPose PoseOf(const TrackObservation& seen) const {
    const bool rolling = camera(seen).line_delay_s.has_value();
    return rolling ? ExposedAt(seen.keyframe, seen.camera, seen.z_px)
                   : poses_[seen.keyframe * thetas_[0].cameras.size() +
                            seen.camera];
  }

  // Predicted minus measured [px] of a homogeneous point in G; by_p_C, unless
  // null, is its derivative with respect to p_C = R_CG X + w p_CG. Returns
  // false and changes neither if the point does not project, or is nearer than
  // kMinDistance_m: a point in the centre of a camera fits any pixel.
  bool Residual(const TrackObservation& seen,
                const Eigen::Vector4d& point_G,
                Eigen::Vector2d* residual_px,
                Eigen::Matrix<double, 2, 3>* by_p_C) const;

 private:
  CameraPose ExposedAt(int keyframe,
                       int camera,
                       const Eigen::Vector2d& z_px) const;

  ChainThetas thetas_;
  std::span<const KeyframeState> keyframes_;
  const KeyframeMotions& motions_;
  double pixel_sigma_px_;
  // Keyframe by keyframe; not used for a rolling shutter.
  std::vector<CameraPose> poses_;
};

// A landmark by inverse depth from the camera that observed it first, with the
// depth axis pointing at it.
struct LandmarkPosition {
  LandmarkAnchor anchor;
  Eigen::Vector3d inverse_depth = Eigen::Vector3d::Zero();

  Eigen::Vector4d Homogeneous() const {
    return anchor.ToHomogeneous(inverse_depth);
  }
  // Position in G [m]; a landmark further away than 10 km is placed at that
  // depth, which is equivalent to infinity.
  Eigen::Vector3d Point() const;

  // Applies a linear step in (alpha, beta, rho): as a step of the point in
  // space if it is small relative to its depth, so that the point moves along
  // with the keyframes that observe it; else as a step of inverse depth, which
  // is regular at infinity.
  void Move(const Eigen::Vector3d& step);
};

// Adds x^T H x + 2 g^T x for a step x of a landmark's position in G.
struct LandmarkPrior {
  Eigen::Matrix3d H;
  Eigen::Vector3d g;
};

// The prior on inverse depth, times a weight, linearised at a position.
LandmarkPrior InverseDepthPrior(const LandmarkPosition& position,
                                double weight);

// Converts a step of p_G = a + R (alpha, beta, 1) / rho to one of (alpha, beta,
// rho), to first order.
Eigen::Vector3d InverseDepthStep(const LandmarkPosition& position,
                                 const Eigen::Vector3d& step_G);

// Position of a homogeneous point in G, anchored at the track's first camera.
LandmarkPosition PositionAt(const LandmarkScene& scene,
                            const Track& track,
                            const Eigen::Vector4d& point_G);

// An observation of a track that a position is based on.
struct UsedObservation {
  int index = 0;      // into the track
  double weight = 1;  // in (0, 1]
};

// Criteria to stop the refinement of a position.
struct RefineLimits {
  int steps = 30;
  // Expected decrease of the cost by the next step [sigma^2]: a step far below
  // one sigma of the position has no measurable effect.
  double decrease = 1e-8;
};

struct RefinedPosition {
  Eigen::Matrix3d information;  // of (alpha, beta, rho)
  double cost = 0;  // sum of the loss and of the prior on inverse depth
  // The minimum lies further beyond infinity than is allowed; the position is
  // the best one within the limit.
  bool behind = false;
};

// Residual assigned to an observation that does not project [sigma]: beyond any
// gate.
inline constexpr double kNotProjectedSigmas = 1e3;

// Minimises the robust reprojection cost of the observations `used`, and the
// prior on inverse depth, by damped Gauss-Newton, with the landmark in front of
// its anchor camera. `*position` is the start, and then the minimum. If the
// start is behind that camera, the search starts at infinity.
RefinedPosition RefinePosition(const LandmarkScene& scene,
                               const Track& track,
                               std::span<const UsedObservation> used,
                               const RobustLoss& loss,
                               const RefineLimits& limits,
                               LandmarkPosition* position);

// All observations of the track, with full weight.
std::vector<UsedObservation> AllOf(const Track& track);

// Norm of each residual [px]; infinite if the landmark does not project.
std::vector<double> ResidualNorms(const LandmarkScene& scene,
                                  const Track& track,
                                  const Eigen::Vector4d& point_G);

}  // namespace selfcal
