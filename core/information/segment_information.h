// The information of one segment about theta (section IV-A of the paper), as a
// value of a few kilobytes that is kept for every segment ever scored.
//
// All matrices are in the tangent units of calibration.h. Pure functions of
// their arguments, callable from any thread, deterministic to the bit.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "core/information/landmark_sketch.h"
#include "core/model/calibration.h"
#include "core/model/rig.h"
#include "core/model/segment.h"

namespace selfcal {

// An unobservable direction of theta, about which the data has less information
// than the prior: a unit vector in units of the prior's sigmas, given by its
// largest parts.
struct UnobservedDirection {
  struct Part {
    std::string component;
    double weight;
  };
  std::vector<Part> parts;   // largest first; at least 90 % of the squared norm
  double information_ratio;  // of the data relative to the prior, in [0, 1)
};

// The score of one group q of k components.
struct GroupScore {
  std::string group;
  int size = 0;  // k
  // H_q of the posterior, normalised by sigma_ref [nat]; lower is more
  // informative.
  double entropy = 0;
  // H_q of the prior minus H_q of the posterior [nat], >= 0.
  double gain = 0;
  // Number of directions of the group with more information from the data than
  // from the prior.
  int rank = 0;
  std::vector<UnobservedDirection> unobserved;  // size - rank of them
};

// Real recordings with states from a SLAM system and noise as specified by the
// manufacturer have a fit within this factor. Beyond it, the factors do not
// model the segment well, and its information is reduced by the square of the
// excess.
inline constexpr double kOrdinaryFit = 2;
// Least redundancy with which a fit is measured.
inline constexpr double kLeastFitRedundancy = 50;

struct ResidualStatistics {
  int observations = 0;
  int inliers = 0;          // used in the score
  int not_projectable = 0;  // behind the camera or outside the model
  int outliers = 0;         // beyond the gate
  int landmarks = 0;
  int landmarks_used = 0;
  double reprojection_rms_px = 0;     // of the inliers
  double reprojection_median_px = 0;  // of all that project
  // Root mean square of the whitened inertial residuals of the first IMU, by
  // kind (rotation, velocity, position, b_a, b_g), and of a second one; empty
  // without one.
  std::vector<double> inertial_rms, second_inertial_rms;
  // Intervals between IMU samples in which samples are missing
  // (core/factor/sampling.h).
  int imu_gaps = 0;
  double longest_imu_gap_s = 0;
  // Root of the remaining squared whitened residuals at the linear minimum over
  // states, landmarks and theta, over their expectation: 1 if motion, noise and
  // model are as stated. 0: not measured.
  double fit = 0;
  // More than 20 % of the observations were excluded.
  bool many_outliers = false;
};

struct SegmentInformation {
  Calibration theta0;  // linearisation point
  // D x D, D = TangentSize(theta0): of the data alone, prior not included.
  Eigen::MatrixXd Lambda;
  Eigen::VectorXd eta;  // D: Lambda (theta [-] theta0) = eta
  int rank = 0;         // of the free components together
  std::vector<UnobservedDirection> unobserved;
  std::vector<GroupScore> groups;  // in the order of rig.groups
  ResidualStatistics residuals;
  LandmarkSketch landmarks;  // those that are used
};

struct ScoreOptions {
  int gauge_keyframe = 0;  // holds the gauge: position and yaw
  // Observations with a residual over this many robust standard deviations
  // (estimated from the median) are excluded; so are landmarks with fewer than
  // two remaining ones.
  double outlier_gate = 5.0;
};

// Linearises all factors of the segment at its own states and theta0 (or, if it
// does not fit, at what FindOffsetStart() finds: result.theta0), whitens them,
// eliminates landmarks and keyframes, and scores every group of the rig.
// The segment must be valid for the rig. Rows of Lambda and eta are zero for
// components that the rig holds fixed. If the fit of the segment exceeds
// kOrdinaryFit, both are divided by the square of the excess.
//
// Throws std::length_error if tracks connect so many keyframes that this would
// take too much memory (about 650; then send fewer in a segment).
//
// Implemented by SegmentScorer: inliers (InlierSelector), linearisation and
// elimination (SegmentLineariser, over ChainElimination), scores (GroupScorer).
SegmentInformation ScoreSegment(const Rig& rig,
                                const Calibration& theta0,
                                const MotionSegment& segment,
                                const ScoreOptions& options = {});

// Computes the scores, which follow from Lambda alone: used by ScoreSegment,
// and again when the groups of a rig or its prior change.
std::vector<GroupScore> ScoreGroups(const Rig& rig,
                                    const Eigen::MatrixXd& Lambda);

// H = 1/2 ln((2 pi e)^k det Sigma_bar) of a covariance normalised by sigma_ref.
double Entropy(const Eigen::MatrixXd& Sigma, const Eigen::VectorXd& sigma_ref);

// Computes entropies without a prior, as in the paper, one for each group;
// nullopt for a group with a direction that the data does not determine (NaN is
// never used).
std::vector<std::optional<double>> EntropiesWithoutPrior(
    const Rig& rig, const Eigen::MatrixXd& Lambda);

}  // namespace selfcal
