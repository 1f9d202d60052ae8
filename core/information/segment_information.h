// What one segment says about theta (section IV-A of the paper), as a value of
// a few kilobytes that is kept for every segment ever scored.
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

// A direction of theta of which the data says less than the prior: a unit
// vector in units of the prior's sigmas, given by its largest parts.
struct UnobservedDirection {
  struct Part {
    std::string component;
    double weight;
  };
  std::vector<Part> parts;   // largest first; at least 90 % of the square
  double information_ratio;  // of the data against the prior, in [0, 1)
};

// The score of one group q of k components.
struct GroupScore {
  std::string group;
  int size = 0;  // k
  // H_q of the posterior, normalised by sigma_ref [nat]; lower is richer.
  double entropy = 0;
  // H_q of the prior minus H_q of the posterior [nat], >= 0.
  double gain = 0;
  // Directions of the group in which the data says more than the prior.
  int rank = 0;
  std::vector<UnobservedDirection> unobserved;  // size - rank of them
};

// Real recordings with states as a SLAM system gives them and noise as their
// makers state it fit to within this factor. Beyond it a segment is not what
// its factors take it for, and its information counts for less, by the square
// of the excess.
inline constexpr double kOrdinaryFit = 2;
// With fewer rows to spare, a fit is not measured.
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
  // Root mean square of the whitened inertial residuals, by kind:
  // (rotation, velocity, position, b_a, b_g).
  std::vector<double> inertial_rms;
  // Steps between IMU samples with room for more (core/factor/sampling.h).
  int imu_gaps = 0;
  double longest_imu_gap_s = 0;
  // Root of what the squares of all whitened residuals keep at the linear
  // minimum over states, landmarks and theta, over their expectation: 1 where
  // motion, noise and model are as stated. 0: not measured.
  double fit = 0;
  // More than 20 % of the observations were left out.
  bool many_outliers = false;
};

struct SegmentInformation {
  Calibration theta0;      // linearisation point
  Eigen::MatrixXd Lambda;  // D x D, of the data alone, prior not included
  Eigen::VectorXd eta;     // D: Lambda (theta [-] theta0) = eta
  int rank = 0;            // of the free components together
  std::vector<UnobservedDirection> unobserved;
  std::vector<GroupScore> groups;  // in the order of rig.groups
  ResidualStatistics residuals;
  LandmarkSketch landmarks;  // that are used
};

struct ScoreOptions {
  int gauge_keyframe = 0;  // carries the fix of position and yaw
  // Observations with a residual over this many robust standard deviations
  // (from the median) are left out; landmarks with fewer than two left are too.
  double outlier_gate = 5.0;
};

// Linearises all factors of the segment at its own states and theta0, whitens
// them, eliminates landmarks and keyframes, and scores every group of the rig.
// The segment must be valid for the rig. Components that the rig holds fixed
// have zero rows in Lambda and eta. Where the segment fits worse than
// kOrdinaryFit, both are divided by the square of the excess.
SegmentInformation ScoreSegment(const Rig& rig,
                                const Calibration& theta0,
                                const MotionSegment& segment,
                                const ScoreOptions& options = {});

// The scores that follow from Lambda alone: used by ScoreSegment, and again
// where the groups of a rig or its prior change.
std::vector<GroupScore> ScoreGroups(const Rig& rig,
                                    const Eigen::MatrixXd& Lambda);

// H = 1/2 ln((2 pi e)^k det Sigma_bar) of a covariance normalised by sigma_ref.
double Entropy(const Eigen::MatrixXd& Sigma, const Eigen::VectorXd& sigma_ref);

// Entropies without a prior, the paper's form, one for each group; a group with
// a direction that the data does not determine has none (NaN is never used).
std::vector<std::optional<double>> EntropiesWithoutPrior(
    const Rig& rig, const Eigen::MatrixXd& Lambda);

}  // namespace selfcal
