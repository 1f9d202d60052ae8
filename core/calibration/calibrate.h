// Recalibration on a set of segments (section IV-C of the paper): partitions,
// gauge, landmark splitting, bias factors over gaps, solved by Ceres.
//
// Deterministic for one thread. Any thread may call; the progress callback is
// called on the calling thread.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "core/calibration/noise_factor.h"
#include "core/calibration/remembered_segment.h"
#include "core/calibration/segment_fit.h"
#include "core/calibration/theta_prior.h"
#include "core/information/segment_information.h"
#include "core/model/calibration.h"
#include "core/model/rig.h"
#include "core/model/segment.h"

namespace selfcal {

enum class LossKind { kNone, kHuber, kCauchy };

// Both lead to the same calibration.
enum class SolverKind {
  kStructured,  // Gauss-Newton on the structure of the problem: fast
  kCeres,
};

struct CalibrateOptions {
  LossKind loss = LossKind::kHuber;
  double loss_scale = 2.0;  // in sigmas
  // What is known about theta besides the segments: FactoryPrior(rig), or what
  // an earlier calibration says about some of it. What neither it nor the data
  // determines is held.
  std::optional<ThetaPrior> prior = std::nullopt;
  int max_iterations = 100;
  // Measures how far the pixel errors of a track go together, and weights them
  // by what that leaves of them (track_noise.h).
  bool correlated_tracks = true;
  // Estimates by which factors the noise of the rig is off (noise_factors.h).
  bool noise_factors = true;
  // Weights by the noise of the rig times these factors, as far as the
  // residuals determine them, instead of by what the rig states.
  bool reweight_noise = true;
  // Segments that contradict the rest, by their residuals or by the theta that
  // they show, are not used (segment_agreement.h).
  bool leave_out_contradictions = true;
  // All segments of the device that are worth using, in the order of time, each
  // session in one run: those that the calibration has the data of, and, with
  // their ends, those that it has not. The result is completed by what these
  // say (evicted_fusion.h).
  std::vector<RememberedSegment> remembered = {};
  // theta random-walks by these densities (D) [tangent units / sqrt(s)], so
  // that what is remembered says less the older it is. Empty: it does not.
  Eigen::VectorXd walk = {};
  // Groups of parameters that have changed before, and may go on to
  // (memory_split.h).
  std::vector<std::string> changing = {};
  int merge_landmarks = 15;  // partitions that share more are merged
  SolverKind solver = SolverKind::kStructured;
  int threads = 1;  // of Ceres
};

struct CalibrateProgress {
  int iteration = 0;
  int max_iterations = 0;
  double cost = 0;
  double step_sigmas = 0;  // largest component of the last step of theta
  Calibration theta = {};
  // Of each tangent component: theta less theta_start, and its standard
  // deviation as far as the last linearisation tells; what the data does not
  // determine so far has that of the prior, what the rig holds fixed has 0.
  Eigen::VectorXd moved = {};
  Eigen::VectorXd sigmas = {};
};

// Returns false to cancel. Iterations do not go back.
using ProgressCallback = std::function<bool(const CalibrateProgress&)>;

enum class CalibrateStatus {
  kConverged,
  kNotConverged,  // max_iterations
  kStalled,       // no step lowers the cost, yet the estimate is not settled
  kCancelled,
  kFailed,  // the solver could not use the problem; see message
};

struct CalibrationResult {
  CalibrateStatus status = CalibrateStatus::kFailed;
  std::string message;
  Calibration theta;
  // D x D, tangent at theta. Zero rows for components held fixed by the rig;
  // a direction that was held constant keeps the prior's variance, so that no
  // sigma is ever small for what was not shown.
  Eigen::MatrixXd covariance;
  // Information about theta (D x D, tangent at theta) of the data, and of what
  // is remembered, also along directions that were held constant.
  Eigen::MatrixXd Lambda;
  int rank = 0;  // estimated directions
  std::vector<UnobservedDirection> held_constant;
  int iterations = 0;
  double initial_cost = 0;
  double final_cost = 0;
  double reprojection_rms_before_px = 0;
  double reprojection_rms_after_px = 0;
  double reprojection_median_before_px = 0;
  double reprojection_median_after_px = 0;
  // The pixel sigma was taken so many times larger than the rig's; 0 in results
  // from before it was measured.
  double track_noise_factor = 1;
  int segments = 0;
  int partitions = 0;
  int keyframes = 0;
  int landmarks = 0;  // variables, split ones counted each
  int landmarks_dropped = 0;
  int observations = 0;  // used
  int observations_dropped = 0;
  // By what the noise that the rig states is off, one of each kind
  // (noise_factors.h); empty where no result was reached, or where they were
  // not asked for.
  std::vector<NoiseFactor> noise_factors;
  // One of each segment that was handed over, by key: also of those that the
  // result does not use. Empty where no result was reached.
  std::vector<SegmentFit> segment_fits;
  // Of calibrations on two halves of the segments.
  AgreementTest halves;
  // What the result has from segments without data.
  EvictedUse evicted;
};

// Calibrates on the segments (valid for the rig, distinct keys, any order),
// from theta_start. The result does not depend on their order.
CalibrationResult Calibrate(const Rig& rig,
                            const Calibration& theta_start,
                            const std::vector<MotionSegment>& segments,
                            const CalibrateOptions& options = {},
                            const ProgressCallback& progress = nullptr);

}  // namespace selfcal
