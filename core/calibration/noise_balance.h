// Squares and redundancies of each kind of noise at the end of a calibration,
// for whitening by any factors on what the rig states: what the factors are
// found from (noise_factors.h). States, landmarks and theta stay where they
// were linearised; that other factors move the minimum is part of the linear
// system.
//
// Keeps the memory of one evaluation for the next. Not for use by two threads
// at once; deterministic.
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <vector>

#include "core/calibration/noise_factor.h"
#include "core/calibration/problem.h"
#include "core/calibration/robust_loss.h"
#include "core/calibration/screening.h"
#include "core/calibration/solver.h"
#include "core/calibration/structured_solver.h"

namespace selfcal {

// By NoiseKind.
using NoiseVector = Eigen::Matrix<double, kNoiseKinds, 1>;

constexpr int IndexOf(NoiseKind kind) { return static_cast<int>(kind); }

// Of whitened residuals at the minimum, and how much of it the unknowns do not
// absorb: equal, on average, where the whitening is right.
struct NoiseBalance {
  NoiseVector squares = NoiseVector::Zero();
  NoiseVector redundancy = NoiseVector::Zero();
};

class NoiseProblem {
 public:
  // The arguments of EstimateNoiseFactors; they must outlive this.
  NoiseProblem(const SolverRound& round,
               const CalibrationEstimate& estimate,
               const std::vector<ScreenedLandmark>& landmarks,
               double track_noise);

  // Nothing where the linear system fails.
  std::optional<NoiseBalance> Evaluate(const NoiseVector& log_factors);

  // Whether at the last factors what reprojections say of all else depended on
  // the pixel sigma.
  bool PixelsCount() const { return excess_ <= 1; }

 private:
  // Of the covariance of one link at unit factors, what each kind brings, of
  // which pixels bring nothing, and what is not known of gaps between samples.
  // A walk moves the motion as well as the biases.
  struct LinkNoise {
    std::array<InertialMatrix, kNoiseKinds> kinds;
    InertialMatrix gaps;
  };

  static std::vector<LinkNoise> SplitInertialNoise(
      const SolverRound& round,
      const ImuCalibration& imu,
      const std::vector<KeyframeState>& keyframes);
  void ScaleLandmarks(double pixel_factor);
  void ScaleInertial(const NoiseVector& factors);
  NoiseBalance Count(const NoiseVector& factors, const RobustLoss& loss) const;
  double AbsorbedByPrior(const Eigen::MatrixXd& inverse) const;
  void AddMotion(const NoiseVector& factors,
                 const LinearPosterior& posterior,
                 NoiseBalance* balance) const;
  void AddPixels(const LinearPosterior& posterior,
                 double unknowns,
                 const RobustLoss& loss,
                 NoiseBalance* balance) const;

  const SolverRound& round_;
  const CalibrationEstimate& estimate_;
  const double track_noise_;
  const std::vector<LinkNoise> inertial_;
  // Scaled by the factors at hand.
  std::vector<ScreenedLandmark> landmarks_;
  double excess_ = 1;  // of the track noise over the pixel sigma
  Rig rig_;
  CalibrationProblem problem_;
  std::vector<InertialMatrix> whitening_;
  LinearisedRound linearised_;
};

}  // namespace selfcal
