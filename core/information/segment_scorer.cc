#include "core/information/segment_scorer.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "core/elimination/by_theta.h"
#include "core/factor/sampling.h"
#include "core/information/offset_start.h"
#include "core/model/second_imu.h"
#include "core/model/symmetric_eigen.h"
#include "core/model/temperature.h"

namespace selfcal {
namespace {

// Sum of squares of the reprojections: two rows for each, in units of the pixel
// sigma.
double PixelSquares(const ResidualStatistics& residuals,
                    double pixel_sigma_px) {
  const double rms = residuals.reprojection_rms_px / pixel_sigma_px;
  return residuals.inliers * rms * rms;
}

// Rows minus unknowns: pixels and inertial links minus landmarks, states
// without the gauge, and observed directions of theta.
double Redundancy(const Calibration& theta,
                  const MotionSegment& segment,
                  const ResidualStatistics& residuals,
                  int rank) {
  constexpr int kGauge = 4;
  const auto keyframes = static_cast<double>(segment.keyframes.size());
  return 2.0 * residuals.inliers +
         ImuCount(theta) * kStateTangentSize * (keyframes - 1) -
         3.0 * residuals.landmarks_used - StateTangentSize(theta) * keyframes +
         kGauge - rank;
}

// Information is never negative; negative eigenvalues after the elimination are
// rounding errors.
Eigen::MatrixXd WithoutNegativePart(const Eigen::MatrixXd& Lambda) {
  const SymmetricEigen eigen(Lambda);
  if (eigen.eigenvalues().minCoeff() >= 0) return Lambda;
  const Eigen::MatrixXd root =
      eigen.eigenvectors() *
      eigen.eigenvalues().cwiseMax(0).cwiseSqrt().asDiagonal();
  const Eigen::MatrixXd product = root * root.transpose();
  return product.selfadjointView<Eigen::Lower>();
}

}  // namespace

// Measures the remaining squares at the linear minimum, with theta constrained
// by its prior. Returns the weight of the information.
double SegmentScorer::MeasureFit(const Rig& rig,
                                 const MotionSegment& segment,
                                 const SharedInformation& theta,
                                 SegmentInformation* result) {
  const std::vector<int>& free = components_.free();
  const auto size = static_cast<Eigen::Index>(free.size());
  gradient_.resize(size);
  for (Eigen::Index j = 0; j < size; ++j) {
    gradient_(j) = components_.prior()(free[j]) * theta.eta(free[j]);
  }
  posterior_ = normalised_;
  posterior_.diagonal().array() += 1;
  double squares =
      PixelSquares(result->residuals, rig.pixel_sigma_px) + theta.constant;
  if (definite_.Factor(posterior_)) {
    squares -= definite_.InverseSquare(gradient_);
  }
  const double redundancy =
      Redundancy(rig.factory, segment, result->residuals, result->rank);
  if (!(redundancy >= kLeastFitRedundancy)) {
    result->residuals.fit = 0;
    return 1;
  }
  result->residuals.fit = std::sqrt(std::max(0.0, squares / redundancy));
  const double excess = result->residuals.fit / kOrdinaryFit;
  return excess > 1 ? 1 / (excess * excess) : 1;
}

const LinearisedSegment& SegmentScorer::Eliminate(
    const Rig& rig,
    const Calibration& theta0,
    const MotionSegment& segment,
    const InlierSelection& selection,
    int gauge_keyframe) {
  if (elimination_) {
    eliminated_ = elimination_(rig, theta0, segment, selection, gauge_keyframe);
    return eliminated_;
  }
  return lineariser_.Eliminate(
      rig, theta0, segment, motions_, selection, order_, gauge_keyframe);
}

void SegmentScorer::Score(const Rig& rig,
                          const Calibration& theta0,
                          const MotionSegment& segment,
                          const ScoreOptions& options,
                          SegmentInformation* result) {
  if (!components_.Fits(rig)) components_ = RigComponents(rig);
  ScoreAt(rig, theta0, segment, options, result);
  if (result->residuals.fit <= kOrdinaryFit) return;
  // Perhaps the states are those of a time offset that is far from the true
  // one.
  const std::optional<OffsetStart> start =
      FindOffsetStart(rig, theta0, segment);
  if (start) ScoreAt(rig, start->theta, start->segment, options, result);
}

void SegmentScorer::ScoreAt(const Rig& rig,
                            const Calibration& theta0,
                            const MotionSegment& given,
                            const ScoreOptions& options,
                            SegmentInformation* result) {
  const SegmentTheta theta_s(theta0, given);
  const StartedSegment started(*theta_s, given);
  const MotionSegment& segment = *started;
  order_.Find(segment, static_cast<int>(theta0.cameras.size()));
  motions_.Measure(rig,
                   *theta_s,
                   components_.estimated_time_offsets(),
                   segment.keyframes,
                   [&](std::size_t k) { return ContextOf(segment, k); });
  const InlierSelection& selection = selector_.Select(
      *theta_s, rig.pixel_sigma_px, segment, motions_, order_, options);
  const LinearisedSegment& linearised =
      Eliminate(rig, *theta_s, segment, selection, options.gauge_keyframe);
  SharedInformation by_theta;
  if (theta_s.varies()) {
    by_theta =
        ByTheta(TemperatureDerivative(theta0, TemperatureOf(theta0, segment)),
                linearised.theta);
  }
  const SharedInformation& information =
      theta_s.varies() ? by_theta : linearised.theta;
  result->theta0 = theta0;
  result->residuals = selection.statistics;
  result->residuals.inertial_rms = linearised.inertial_rms;
  result->residuals.second_inertial_rms = linearised.second_inertial_rms;
  const SampleGaps gaps = FindGaps(SamplesBetweenKeyframes(segment));
  result->residuals.imu_gaps = gaps.count;
  result->residuals.longest_imu_gap_s = gaps.longest_s;
  SketchLandmarks(segment, selection.inliers, &result->landmarks);

  // Over the free components, in units of the prior.
  const std::vector<int>& free = components_.free();
  const Eigen::VectorXd& prior = components_.prior();
  const auto size = static_cast<Eigen::Index>(free.size());
  normalised_.resize(size, size);
  for (Eigen::Index j = 0; j < size; ++j) {
    for (Eigen::Index i = 0; i < size; ++i) {
      normalised_(i, j) = prior(free[i]) * prior(free[j]) *
                          information.Lambda(free[i], free[j]);
    }
  }
  if (!definite_.Factor(normalised_)) {
    normalised_ = WithoutNegativePart(normalised_);
  }
  group_scorer_.Observe(normalised_,
                        components_.free_names(),
                        &result->rank,
                        &result->unobserved,
                        &observed_);
  const double discount = MeasureFit(rig, segment, information, result);
  if (discount < 1) {
    normalised_ *= discount;
    group_scorer_.Observe(normalised_,
                          components_.free_names(),
                          &result->rank,
                          &result->unobserved,
                          &observed_);
  }
  result->Lambda.setZero(prior.size(), prior.size());
  result->eta.setZero(prior.size());
  for (Eigen::Index j = 0; j < size; ++j) {
    // Each coefficient is scaled alone, so that the matrix stays symmetric to
    // the bit.
    for (Eigen::Index i = 0; i < size; ++i) {
      result->Lambda(free[i], free[j]) =
          normalised_(i, j) / (prior(free[i]) * prior(free[j]));
    }
    result->eta(free[j]) = discount * information.eta(free[j]);
  }
  group_scorer_.Score(components_, normalised_, &result->groups);
}

}  // namespace selfcal
