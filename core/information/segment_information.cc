#include "core/information/segment_information.h"

#include "core/information/segment_scorer.h"

namespace selfcal {

SegmentInformation ScoreSegment(const Rig& rig,
                                const Calibration& theta0,
                                const MotionSegment& segment,
                                const ScoreOptions& options) {
  SegmentInformation result;
  SegmentScorer().Score(rig, theta0, segment, options, &result);
  return result;
}

}  // namespace selfcal
