// Squares and redundancies of each kind of noise at the end of a calibration,
// for whitening with any scales of the rig's stated noise; noise_scales.h
// finds the noise scales from them. States, landmarks and theta stay at their
// linearisation point; the shift of the minimum for other scales is part of the
// linear system.
//
// Reuses the memory of one evaluation for the next. Not thread-safe;
// deterministic.
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <vector>

#include "core/calibration/chain_thetas.h"
#include "core/calibration/noise_scale.h"
#include "core/calibration/problem.h"
#include "core/calibration/robust_loss.h"
#include "core/calibration/screening.h"
#include "core/calibration/solver.h"
#include "core/calibration/structured_solver.h"

namespace selfcal {

// Indexed by NoiseKind, of which there are kNoiseKinds, or with a second IMU
// kMaxNoiseKinds.
template <int kinds>
using NoiseVector = Eigen::Matrix<double, kinds, 1>;

// Squares of whitened residuals at the minimum, and the part of them that the
// unknowns do not absorb: equal on average if the whitening is right.
template <int kinds>
struct NoiseBalance {
  NoiseVector<kinds> squares = NoiseVector<kinds>::Zero();
  NoiseVector<kinds> redundancy = NoiseVector<kinds>::Zero();
};

template <int kinds>
class NoiseProblem {
 public:
  using Vector = NoiseVector<kinds>;
  using Balance = NoiseBalance<kinds>;

  // The arguments are those of EstimateNoiseScales; they must outlive this. The
  // noise of pixels relative to all other factors is their scale times
  // `least_excess`, or the track noise if that is larger. Below one, weights of
  // landmarks exceed one here.
  NoiseProblem(const SolverRound& round,
               const CalibrationEstimate& estimate,
               const std::vector<ScreenedLandmark>& landmarks,
               double track_noise,
               double least_excess = 1);

  // Returns nullopt if the linear system fails.
  std::optional<Balance> Evaluate(const Vector& log_factors);

  // Returns true if, at the last noise scales, the weight of reprojections
  // relative to all other factors depended on the pixel sigma.
  bool PixelsCount() const { return excess_ <= least_excess_; }

 private:
  // Parts of the covariance of one link at unit noise scales: that of each kind
  // of its IMU, and that of gaps between samples. A random walk affects the
  // motion as well as the biases.
  struct LinkNoise {
    int imu = 0;
    std::array<InertialMatrix, kNoiseKindsOfImu> of_kinds;
    InertialMatrix gaps;
  };

  static std::vector<LinkNoise> SplitInertialNoise(
      const SolverRound& round,
      const ChainThetas& thetas,
      const std::vector<KeyframeState>& keyframes);
  void ScaleLandmarks(double pixel_factor);
  void ScaleInertial(const Vector& factors);
  Balance Count(const Vector& factors, const RobustLoss& loss) const;
  double AbsorbedByPrior(const Eigen::MatrixXd& inverse) const;
  void AddMotion(const Vector& factors,
                 const LinearPosterior& posterior,
                 Balance* balance) const;
  void AddPixels(const LinearPosterior& posterior,
                 double unknowns,
                 const RobustLoss& loss,
                 Balance* balance) const;

  const SolverRound& round_;
  const CalibrationEstimate& estimate_;
  const double track_noise_;
  const double least_excess_;
  const std::vector<LinkNoise> inertial_;
  // Weights scaled by the current noise scales.
  std::vector<ScreenedLandmark> landmarks_;
  double excess_ = 1;  // of the noise of pixels over the pixel sigma
  Rig rig_;
  CalibrationProblem problem_;
  std::vector<InertialMatrix> whitening_;
  LinearisedRound linearised_;
};

}  // namespace selfcal
