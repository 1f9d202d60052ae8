#include "core/verify/scorer.h"

#include "core/information/segment_scorer.h"
#include "core/verify/ceres_elimination.h"

namespace selfcal {

SegmentInformation ScoreSegmentBy(ScorerKind scorer,
                                  const Rig& rig,
                                  const Calibration& theta0,
                                  const MotionSegment& segment,
                                  const ScoreOptions& options) {
  if (scorer == ScorerKind::kStructured) {
    return ScoreSegment(rig, theta0, segment, options);
  }
  SegmentInformation result;
  SegmentScorer(EliminateByCeres).Score(rig, theta0, segment, options, &result);
  return result;
}

}  // namespace selfcal
