// Which observations of a segment a score stands on, and where its landmarks
// are linearised. Pure, deterministic for one width of vectors.
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
  // In G [m], one for each landmark of the segment: refined where that lowers
  // the robust reprojection error, else as the SLAM system gave it.
  std::vector<Eigen::Vector3d> landmarks;
  // Indices into segment.observations, sorted by (landmark, keyframe, camera).
  std::vector<int> inliers;
  // All but inertial_rms.
  ResidualStatistics statistics;
};

// Moves each landmark by up to two Gauss-Newton steps with the keyframes held,
// so that the noise of a landmark does not hide which of its observations is
// wrong; then leaves out what does not project, what lies further than
// options.outlier_gate robust standard deviations (from the median residual of
// the segment, at least pixel_sigma_px) from its prediction, and landmarks with
// fewer than two observations left.
//
// A step lowers the Huber cost of a landmark. Its distance is held weakly, to
// about half of itself, so that a point without parallax stays where it was; a
// step that loses an observation that projected is not taken.
//
// A workspace for one thread: nothing is allocated once it has seen the largest
// segment.
class InlierSelector {
 public:
  explicit InlierSelector(VectorWidth width = WidestVectors())
      : kernels_(width) {}

  // `motions` and `order` are those of the segment. The result is good until
  // the next call.
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
  std::vector<double> trial_squares_;  // of a run
  std::vector<double> distance_priors_;
  std::vector<char> moving_;
  std::vector<LandmarkSums> sums_, trial_sums_;
  // Squared residuals [px^2] by observation; negative where it does not
  // project.
  std::vector<double> squares_, new_squares_, sorted_;
};

// The same for one segment.
InlierSelection SelectInliers(const Rig& rig,
                              const Calibration& theta0,
                              const MotionSegment& segment,
                              const ScoreOptions& options);

}  // namespace selfcal
