// What all segments ever scored say together, without their data: information
// of segments that share nothing adds, so that their sum with the prior gives
// one Gauss-Newton step of the whole calibration, and its covariance.
//
// The step is as good as the linearisation: each segment stands at the states
// of its SLAM system and at the calibration that it was scored with, and cannot
// be linearised anew without its data. docs/concepts.md says how far that is
// from a recalibration; `reach` tells when it is too far.
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

// The same information by the offset from another point: with
// b = point [-] theta0, theta [-] theta0 = b + J_r(b)^-1 (theta [-] point) to
// first order, where J_r stands on the rotations alone. `point` must have the
// shape of information.theta0.
ThetaInformation Transport(const SegmentInformation& information,
                           const Calibration& point);

// With a reach [reference sigmas] up to here, the covariance of the fused
// estimate tells how far it is from the truth (docs/evaluation.md).
inline constexpr double kEnoughReach = 0.5;

struct FusedEstimate {
  Calibration theta;
  // D x D, tangent at theta: of the data and the prior. Zero rows for
  // components that the rig holds fixed.
  Eigen::MatrixXd covariance;
  // Of the data alone, as of one segment.
  int rank = 0;
  std::vector<UnobservedDirection> unobserved;
  int segments = 0;
  // How much more the segments differ than their information says: the sum of
  // (theta_i [-] theta)^2, weighted by what each knows, against its
  // expectation. 1 where the noise is that of the rig, whatever the reach:
  // segments that were all scored at the same wrong calibration are wrong
  // together. 0 without segments.
  double heterogeneity = 0;
  // From the calibration at which a segment was scored to the estimate, in
  // reference sigmas: rms over the free components, the largest of all
  // segments. 0 without segments.
  double reach = 0;
};

// The sum of all segments and of the rig's prior about rig.factory. Segments
// may have been scored at different calibrations; each must have the shape of
// rig.factory. Fixed components keep the factory's value.
FusedEstimate Fuse(const Rig& rig,
                   std::span<const SegmentInformation> segments);

}  // namespace selfcal
