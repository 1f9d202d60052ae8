// Scores segments: ScoreSegment() of segment_information.h with the memory that
// it works in, for one thread. Nothing is allocated once it has seen the
// largest segment of a rig, but for the names of directions that a segment does
// not observe.
#pragma once

#include <Eigen/Core>

#include "core/factor/keyframe_motion.h"
#include "core/information/group_scorer.h"
#include "core/information/inliers.h"
#include "core/information/linearisation.h"
#include "core/information/observation_order.h"
#include "core/information/rig_components.h"
#include "core/information/segment_information.h"

namespace selfcal {

class SegmentScorer {
 public:
  explicit SegmentScorer(VectorWidth width = WidestVectors())
      : selector_(width), lineariser_(width) {}

  // As ScoreSegment(); *result is overwritten.
  void Score(const Rig& rig,
             const Calibration& theta0,
             const MotionSegment& segment,
             const ScoreOptions& options,
             SegmentInformation* result);

 private:
  double MeasureFit(const Rig& rig,
                    const MotionSegment& segment,
                    const SharedInformation& theta,
                    SegmentInformation* result);

  ObservationOrder order_;
  KeyframeMotions motions_;
  InlierSelector selector_;
  SegmentLineariser lineariser_;
  RigComponents components_;
  GroupScorer group_scorer_;
  DefiniteMatrix definite_, observed_;
  Eigen::MatrixXd normalised_, posterior_;
  Eigen::VectorXd gradient_;
};

}  // namespace selfcal
