// The joint information of all segments ever scored, without their data. The
// information of segments that share nothing is additive, so that the sum with
// the prior gives one Gauss-Newton step of the whole calibration, and its
// covariance.
//
// The step is as good as the linearisation: each segment is linearised at the
// states of its SLAM system and at the calibration that it was scored with, and
// cannot be relinearised without its data. docs/concepts.md states how far that
// is from a recalibration; `reach` shows when it is too far.
//
// Pure functions, callable from any thread, deterministic.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "core/information/segment_information.h"
#include "core/model/calibration.h"
#include "core/model/rig.h"

namespace selfcal {

// Information about the offset from a point: Lambda (theta [-] point) = eta.
struct ThetaInformation {
  Eigen::MatrixXd Lambda;  // D x D
  Eigen::VectorXd eta;     // D
};

// Transports the same information to the offset from another point: with
// b = point [-] theta0,
//   theta [-] theta0 = b + J_r(b)^-1 (theta [-] point)
// to first order, where J_r acts on the rotations only. `point` must have the
// shape of information.theta0.
ThetaInformation Transport(const SegmentInformation& information,
                           const Calibration& point);

// Up to this reach [reference sigmas], the covariance of the fused estimate
// states its actual error (docs/evaluation.md).
inline constexpr double kEnoughReach = 0.5;

struct FusedEstimate {
  Calibration theta;
  // D x D, tangent at theta: covariance given the data and the prior. Rows of
  // components that the rig holds fixed are zero.
  Eigen::MatrixXd covariance;
  // Rank of the data alone, as for one segment.
  int rank = 0;
  std::vector<UnobservedDirection> unobserved;
  int segments = 0;
  // Ratio of the differences among the segments to those that their information
  // predicts: the sum of (theta_i [-] theta)^2, weighted by the information of
  // each, over its expectation. It is 1 if the noise is that of the rig,
  // regardless of the reach: segments that were all scored at the same wrong
  // calibration have a common error. 0 without segments.
  double heterogeneity = 0;
  // Distance from the calibration at which a segment was scored to the
  // estimate, in reference sigmas: rms over the free components, maximum over
  // the segments. 0 without segments.
  double reach = 0;
};

// Sums the information of all segments and of the rig's prior about
// PriorMean(rig). Segments may have been scored at different calibrations; each
// must have the shape of rig.factory. Fixed components keep the factory value.
FusedEstimate Fuse(const Rig& rig,
                   std::span<const SegmentInformation> segments);

}  // namespace selfcal
