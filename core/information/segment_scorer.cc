#include "core/information/segment_scorer.h"

#include <Eigen/Eigenvalues>

namespace selfcal {
namespace {

// Information is never negative; what the elimination leaves below zero is
// rounding.
Eigen::MatrixXd WithoutNegativePart(const Eigen::MatrixXd& Lambda) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(Lambda);
  if (eigen.eigenvalues().minCoeff() >= 0) return Lambda;
  const Eigen::MatrixXd root =
      eigen.eigenvectors() *
      eigen.eigenvalues().cwiseMax(0).cwiseSqrt().asDiagonal();
  const Eigen::MatrixXd product = root * root.transpose();
  return product.selfadjointView<Eigen::Lower>();
}

}  // namespace

void SegmentScorer::Score(const Rig& rig,
                          const Calibration& theta0,
                          const MotionSegment& segment,
                          const ScoreOptions& options,
                          SegmentInformation* result) {
  if (!components_.Fits(rig)) components_ = RigComponents(rig);
  order_.Find(segment, static_cast<int>(theta0.cameras.size()));
  motions_.Measure(rig,
                   theta0,
                   components_.estimated_time_offsets(),
                   segment.keyframes,
                   [&](std::size_t) { return std::span(segment.imu); });
  const InlierSelection& selection = selector_.Select(
      theta0, rig.pixel_sigma_px, segment, motions_, order_, options);
  const LinearisedSegment& linearised =
      lineariser_.Eliminate(rig,
                            theta0,
                            segment,
                            motions_,
                            selection,
                            order_,
                            options.gauge_keyframe);
  result->theta0 = theta0;
  result->residuals = selection.statistics;
  result->residuals.inertial_rms = linearised.inertial_rms;
  SketchLandmarks(segment, selection.inliers, &result->landmarks);

  // In units of the prior, over the free components.
  const std::vector<int>& free = components_.free();
  const Eigen::VectorXd& prior = components_.prior();
  const auto size = static_cast<Eigen::Index>(free.size());
  normalised_.resize(size, size);
  for (Eigen::Index j = 0; j < size; ++j) {
    for (Eigen::Index i = 0; i < size; ++i) {
      normalised_(i, j) = prior(free[i]) * prior(free[j]) *
                          linearised.theta.Lambda(free[i], free[j]);
    }
  }
  if (!definite_.Factor(normalised_)) {
    normalised_ = WithoutNegativePart(normalised_);
  }
  result->Lambda.setZero(prior.size(), prior.size());
  result->eta.setZero(prior.size());
  for (Eigen::Index j = 0; j < size; ++j) {
    // Coefficient by coefficient, so that it stays symmetric to the bit.
    for (Eigen::Index i = 0; i < size; ++i) {
      result->Lambda(free[i], free[j]) =
          normalised_(i, j) / (prior(free[i]) * prior(free[j]));
    }
    result->eta(free[j]) = linearised.theta.eta(free[j]);
  }
  group_scorer_.Observe(normalised_,
                        components_.free_names(),
                        &result->rank,
                        &result->unobserved,
                        &observed_);
  group_scorer_.Score(components_, normalised_, &result->groups);
}

}  // namespace selfcal
