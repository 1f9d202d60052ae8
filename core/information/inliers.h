// Selection of the observations of a segment that its score is based on, and of
// the points at which its landmarks are linearised. Pure, deterministic for one
// width of vectors.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "core/factor/keyframe_motion.h"
#include "core/factor/reprojection_batch.h"
#include "core/information/observation_order.h"
#include "core/information/segment_information.h"
#include "core/model/calibration.h"
#include "core/model/rig.h"
#include "core/model/segment.h"

namespace selfcal {

struct InlierSelection {
  // Positions in G [m], one for each landmark of the segment: refined if that
  // reduces the robust reprojection error, else as the SLAM system estimated
  // them.
  std::vector<Eigen::Vector3d> landmarks;
  // Indices into segment.observations, sorted by (landmark, keyframe, camera).
  std::vector<int> inliers;
  // All fields but those of inertial residuals.
  ResidualStatistics statistics;
};

// Moves each landmark by up to two Gauss-Newton steps with the keyframes held
// constant, so that the noise of a landmark does not hide outliers among its
// observations. Then it excludes observations that do not project or are
// further than options.outlier_gate robust standard deviations (estimated from
// the median residual of the segment, at least pixel_sigma_px) from their
// prediction, and landmarks with fewer than two remaining observations.
//
// A step decreases the Huber cost of a landmark. A weak prior, with a sigma of
// about half the distance, holds the distance of the landmark, so that a point
// without parallax stays in place; a step after which an observation no longer
// projects is rejected.
//
// A workspace for one thread: it allocates nothing after the largest segment.
class InlierSelector {
 public:
  explicit InlierSelector(VectorWidth width = WidestVectors())
      : kernels_(width) {}

  // `motions` and `order` are those of the segment, and theta0 is its theta_s
  // (temperature.h). The result is valid until the next call.
  const InlierSelection& Select(const Calibration& theta0,
                                double pixel_sigma_px,
                                const MotionSegment& segment,
                                const KeyframeMotions& motions,
                                const ObservationOrder& order,
                                const ScoreOptions& options);

 private:
  void Evaluate(const Calibration& theta0,
                double pixel_sigma_px,
                const MotionSegment& segment,
                const KeyframeMotions& motions,
                const ObservationOrder& order);
  void StartLandmarks(const MotionSegment& segment,
                      const ObservationOrder& order);
  bool ProposeSteps(const MotionSegment& segment);
  void TakeSteps(const ObservationOrder& order);
  void Classify(double gate_px,
                const MotionSegment& segment,
                const ObservationOrder& order);
  double MedianOfProjected();

  ReprojectionBatch kernels_;
  ObservationRuns runs_;
  InlierSelection result_;
  std::vector<double> trial_points_;   // 3 for each landmark
  std::vector<double> trial_squares_;  // of one run
  std::vector<double> distance_priors_;
  std::vector<char> moving_;
  std::vector<LandmarkSums> sums_, trial_sums_;
  // Squared residuals [px^2] by observation; negative if it does not project.
  std::vector<double> squares_, new_squares_, sorted_;
};

// Selects the inliers of one segment, with theta0 at its temperature.
InlierSelection SelectInliers(const Rig& rig,
                              const Calibration& theta0,
                              const MotionSegment& segment,
                              const ScoreOptions& options);

}  // namespace selfcal
