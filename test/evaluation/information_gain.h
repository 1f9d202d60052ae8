// The incremental estimator of Maye, Furgale, Siegwart ("Self-supervised
// Calibration for Robotic Systems", IV 2013), on the factors and the solver of
// this project.
//
// Segment after segment, a whole calibration runs over the database and the
// candidate. A truncated rank-revealing QR of what is left for theta tells the
// observable directions. The candidate is kept if it makes more of them
// observable, or if at the same number the information gain about theta is
// above a threshold. The database is not bounded.
//
// QR of the whitened Jacobian with theta ordered last ends in the triangle
// R_theta. The structured elimination gives R_theta^T R_theta, normalised by
// the prior's sigmas (a condition of some 1e4, so that squares do no harm), in
// a fraction of the time; what reveals the rank then works on R_theta alone.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/calibration/calibrate.h"
#include "core/model/rig.h"
#include "core/model/segment.h"
#include "test/evaluation/estimators.h"

namespace selfcal {

// Of a square root R_theta in units of the prior: column-pivoted Householder
// QR; pivots below the threshold are cut off.
struct TruncatedQr {
  int rank = 0;
  double half_log_det = 0;  // of the information that is left: sum ln |R_jj|
};
TruncatedQr TruncateRoot(const Eigen::MatrixXd& root, double truncation);

// The same of the information Lambda about theta, in tangent units.
TruncatedQr TruncateInformation(const Rig& rig,
                                const Eigen::MatrixXd& Lambda,
                                double truncation);

struct GainOptions {
  // A candidate must gain more than this [nat]; chosen by the experiment
  // gain_threshold.
  double threshold_nats = 1.25;
  // Smallest |R_jj| of an observable direction. At 1 the data says as much as
  // the prior; below, the solver holds a direction constant.
  double truncation = 1;
  // Stops when so many are kept; 0: goes through all segments.
  int stop_at = 0;
};

struct GainResult {
  SegmentSet kept;
  // Of each candidate [nat]; 0 where the rank is another than before.
  std::vector<double> gains;
  std::vector<bool> rank_rose;
  CalibrationResult calibration;  // of the kept segments
};

// Calibrates from the factory's calibration, then each time from where the
// database stands. A candidate with which the solver does not converge is not
// kept.
GainResult RunInformationGain(
    const Rig& rig,
    const std::vector<MotionSegment>& segments,
    const GainOptions& options,
    const CalibrateOptions& calibrate = ComparedOptions());

}  // namespace selfcal
