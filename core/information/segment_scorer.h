// Scores segments: ScoreSegment() of segment_information.h with a reusable
// workspace, for one thread. After the largest segment of a rig it allocates
// nothing except the names of unobservable directions.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <utility>

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
  // An alternative implementation of SegmentLineariser::Eliminate.
  using Elimination =
      std::function<LinearisedSegment(const Rig& rig,
                                      const Calibration& theta0,
                                      const MotionSegment& segment,
                                      const InlierSelection& selection,
                                      int gauge_keyframe)>;

  explicit SegmentScorer(VectorWidth width = WidestVectors())
      : selector_(width), lineariser_(width) {}
  // Uses `elimination` instead of the structured one.
  explicit SegmentScorer(Elimination elimination)
      : elimination_(std::move(elimination)) {}

  // Same as ScoreSegment(); *result is overwritten.
  void Score(const Rig& rig,
             const Calibration& theta0,
             const MotionSegment& segment,
             const ScoreOptions& options,
             SegmentInformation* result);

 private:
  void ScoreAt(const Rig& rig,
               const Calibration& theta0,
               const MotionSegment& segment,
               const ScoreOptions& options,
               SegmentInformation* result);
  double MeasureFit(const Rig& rig,
                    const MotionSegment& segment,
                    const SharedInformation& theta,
                    SegmentInformation* result);

  const LinearisedSegment& Eliminate(const Rig& rig,
                                     const Calibration& theta0,
                                     const MotionSegment& segment,
                                     const InlierSelection& selection,
                                     int gauge_keyframe);

  Elimination elimination_;       // empty: the structured one
  LinearisedSegment eliminated_;  // by elimination_
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
