// Recalibration on a set of segments (section IV-C of the paper): partitions,
// gauge, landmark splitting, bias factors over gaps, and a solver (SolverKind).
//
// Deterministic for one thread. Callable from any thread; the progress callback
// runs on the calling thread.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "core/calibration/noise_scale.h"
#include "core/calibration/remembered_segment.h"
#include "core/calibration/segment_fit.h"
#include "core/calibration/theta_prior.h"
#include "core/information/segment_information.h"
#include "core/model/calibration.h"
#include "core/model/rig.h"
#include "core/model/segment.h"

namespace selfcal {

enum class LossKind { kNone, kHuber, kCauchy };

// Both solvers lead to the same calibration.
enum class SolverKind {
  kStructured,  // Gauss-Newton on the structure of the problem: fast
  kCeres,
};

struct CalibrateOptions {
  LossKind loss = LossKind::kHuber;
  double loss_scale = 2.0;  // in sigmas
  // Prior on theta: FactoryPrior(rig), or the result of an earlier calibration
  // for some of the components. Directions that neither the prior nor the data
  // determines are held constant.
  std::optional<ThetaPrior> prior = std::nullopt;
  int max_iterations = 100;
  // Measures the correlation of the pixel errors along tracks, and weights them
  // accordingly (track_noise.h).
  bool correlated_tracks = true;
  // Estimates the noise scales of the rig (noise_scales.h).
  bool noise_scales = true;
  // Weights by the noise of the rig times the noise scales, as far as the
  // residuals determine them, instead of by the noise that the rig states.
  bool reweight_noise = true;
  // Excludes segments that contradict the rest, by their residuals or by their
  // own estimate of theta (segment_agreement.h).
  bool exclude_contradictions = true;
  // All usable segments of the device, in the order of time, with those of a
  // session consecutive: those with data in the calibration and, with their
  // ends, those without data. The information of the latter completes the
  // result (remembered_fusion.h).
  std::vector<RememberedSegment> remembered = {};
  // Densities (D) of a random walk of theta [tangent units / sqrt(s)], by which
  // remembered information decreases with age. Empty: it does not decrease.
  Eigen::VectorXd walk = {};
  // Groups of parameters that have changed before, and may continue to
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
  // Difference theta minus theta_start for each tangent component, and its
  // standard deviation according to the last linearisation. The standard
  // deviation is that of the prior for directions that the data does not
  // determine so far, and 0 for components that the rig holds fixed.
  Eigen::VectorXd moved = {};
  Eigen::VectorXd sigmas = {};
};

// Returns false to cancel. The iteration number never decreases.
using ProgressCallback = std::function<bool(const CalibrateProgress&)>;

enum class CalibrateStatus {
  kConverged,
  kNotConverged,  // max_iterations
  kStalled,  // no step decreases the cost, but the estimate has not converged
  kCancelled,
  kFailed,  // the solver could not process the problem; see message
};

struct CalibrationResult {
  CalibrateStatus status = CalibrateStatus::kFailed;
  std::string message;
  Calibration theta;
  // D x D, tangent at theta. Rows of components that the rig holds fixed are
  // zero; a direction that was held constant keeps the prior's variance, so
  // that no sigma is small for a parameter that was not observed.
  Eigen::MatrixXd covariance;
  // The same of the data alone, without remembered segments and the doubt about
  // a device change, at the theta without them; empty if they change nothing.
  Eigen::MatrixXd covariance_of_data;
  // Information about theta (D x D, tangent at theta) of the data and of the
  // remembered segments, also along directions that were held constant.
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
  // Factor on the rig's pixel sigma due to correlated tracks; 0 in results from
  // before it was measured.
  double track_noise_factor = 1;
  int segments = 0;
  int partitions = 0;
  int keyframes = 0;
  int landmarks = 0;  // variables; those of split landmarks count separately
  int landmarks_dropped = 0;
  int observations = 0;  // used
  int observations_dropped = 0;
  // Noise scales relative to the noise that the rig states, one for each kind
  // (noise_scales.h); empty if there is no result or they were not requested.
  std::vector<NoiseScale> noise_scales;
  // One for each input segment, by key, including those that the result does
  // not use. Empty if there is no result.
  std::vector<SegmentFit> segment_fits;
  // Test of calibrations on two halves of the segments against each other.
  AgreementTest halves;
  // Contribution of segments without data.
  RememberedUse remembered;
};

// Calibrates on the segments (valid for the rig, distinct keys, any order),
// starting from theta_start, but for time offsets that the segments show to be
// far from it (core/information/offset_start.h). The result does not depend on
// the order of the segments.
CalibrationResult Calibrate(const Rig& rig,
                            const Calibration& theta_start,
                            const std::vector<MotionSegment>& segments,
                            const CalibrateOptions& options = {},
                            const ProgressCallback& progress = nullptr);

}  // namespace selfcal
