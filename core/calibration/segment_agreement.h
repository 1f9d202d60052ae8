// Tests whether the segments of a calibration agree: each with all others, and
// both halves with each other; and finds those that contradict the rest.
//
// At the minimum of a calibration each segment is linearised alone, at the
// states and landmarks and with the weights of the joint estimate
// (segment_part.h), and tested against the sum of all others (agreement.h).
// Other weights would test how errors scatter that the estimate does not have:
// residuals with heavy tails move an unweighted sum by far more
// than a robust estimate.
//
// Pure, callable from any thread, deterministic.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "core/calibration/segment_fit.h"
#include "core/calibration/working_point.h"

namespace selfcal {

// Fewer segments have no majority: halves are not tested, and no contradictions
// found.
inline constexpr int kLeastToAgree = 4;

// Information of one segment at the minimum, along the estimated directions in
// units of the prior (r x r, r).
struct SegmentEvidence {
  Eigen::MatrixXd Lambda;
  Eigen::VectorXd eta;
  SegmentFit fit;  // its key and the ratios of its residuals
};

// The evidence at the minimum, with the weights of the calibration. `segments`
// are those of its problem; `squares_of_a_reprojection` is the expected sum of
// squares of its two whitened rows, 0 if unknown.
std::vector<SegmentEvidence> CollectEvidence(
    const WorkingPoint& point,
    const std::vector<const MotionSegment*>& segments,
    double squares_of_a_reprojection);

// Tests each against all others, in `fit.others`. Returns the ratio of the
// squares of all these tests to their expectation, 1 or more: if segments
// disagree by more than their information predicts, covariances are too small
// by this factor.
double TestEach(std::vector<SegmentEvidence>* evidence);

// Tests the first half of the segments, in their order, against the second,
// with variances scaled by `excess`. Not tested with fewer than kLeastToAgree.
AgreementTest TestHalves(const std::vector<SegmentEvidence>& evidence,
                         double excess);

// A segment that contradicts the rest, and the reason. Segments are excluded
// one after the other, worst fit first, as long as a majority agrees. They are
// compared with the typical values of the others, since the stated noise may be
// wrong for all. If the estimate has not converged, only their theta is tested:
// neighbours of a bad segment then have large residuals as well.
struct Contradiction {
  int segment = 0;
  std::string reason;
};
std::vector<Contradiction> FindContradictions(
    const std::vector<SegmentEvidence>& evidence, bool converged);

// Finds contradictions before the solve, from the fit of each segment alone
// (ResidualStatistics::fit; 0: not measured).
std::vector<Contradiction> FindMisfits(const std::vector<double>& fits);

}  // namespace selfcal
