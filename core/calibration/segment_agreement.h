// Whether the segments of a calibration agree: each with all others, and both
// halves of them with each other; and which of them contradict the rest.
//
// At the minimum of a calibration each segment is linearised alone, at the
// states and landmarks of the joint estimate, and tested against the sum of all
// others (agreement.h).
//
// Pure, any thread, deterministic.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "core/calibration/problem.h"
#include "core/calibration/screening.h"
#include "core/calibration/segment_fit.h"
#include "core/calibration/subspace.h"
#include "core/model/rig.h"

namespace selfcal {

// What one segment says at the minimum, by the estimated directions in units of
// the prior (r x r, r).
struct SegmentEvidence {
  Eigen::MatrixXd Lambda;
  Eigen::VectorXd eta;
  SegmentFit fit;  // its key and the ratios of its residuals
};

// `rig` with the noise that the calibration was weighted with; `segments` as
// its problem was made of them; the squares that are expected of the two rows
// of a reprojection, 0 if that is not known.
std::vector<SegmentEvidence> CollectEvidence(
    const Rig& rig,
    const Calibration& theta,
    const std::vector<const MotionSegment*>& segments,
    const CalibrationProblem& problem,
    const std::vector<KeyframeState>& keyframes,
    const Screening& screening,
    const ThetaSubspace& subspace,
    double squares_of_a_reprojection);

// Each against all others, in `fit.others`; returns by how much the squares of
// all these tests exceed their expectation, 1 or more: where segments disagree
// by more than they say, covariances are too small by that.
double TestEach(std::vector<SegmentEvidence>* evidence);

// The first half of the segments, in their order, against the second, with
// variances larger by `excess`. Not tested with fewer than four.
AgreementTest TestHalves(const std::vector<SegmentEvidence>& evidence,
                         double excess);

// The segments that contradict the rest, as a list of index and reason: one
// after the other, those that fit worst, while a majority agrees. Measured by
// what is usual for the others, since stated noise may be wrong for all. Where
// the estimate has not converged, by their theta alone: neighbours of a segment
// that is wrong then have large residuals as well.
struct Contradiction {
  int segment = 0;
  std::string reason;
};
std::vector<Contradiction> FindContradictions(
    const std::vector<SegmentEvidence>& evidence, bool converged);

// The same before anything is solved, from how well each segment fits by itself
// (ResidualStatistics::fit; 0: not measured).
std::vector<Contradiction> FindMisfits(const std::vector<double>& fits);

}  // namespace selfcal
