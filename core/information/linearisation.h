// The whitened, linearised factors of a segment, handed to the elimination
// (section IV-A, steps 1 and 2). Pure, deterministic for one width of vectors.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/elimination/chain_elimination.h"
#include "core/factor/keyframe_motion.h"
#include "core/factor/link_batch.h"
#include "core/factor/reprojection_batch.h"
#include "core/information/inlier_tracks.h"
#include "core/information/inliers.h"
#include "core/information/observation_order.h"
#include "core/model/calibration.h"
#include "core/model/rig.h"
#include "core/model/segment.h"

namespace selfcal {

// Information about the states of the first keyframe of a chain, of 15 unknowns
// or with a second IMU of 24, with the sigmas of weak_priors.h: about its
// velocities and biases, and about the gauge, which is unobservable and held
// constant.
ChainStateMatrix MotionPrior(int size = kChainStateSize);
ChainStateMatrix GaugePrior(const KeyframeState& x, int size = kChainStateSize);

struct LinearisedSegment {
  SharedInformation theta;  // over the whole tangent, in its units
  // As in ResidualStatistics.
  std::vector<double> inertial_rms, second_inertial_rms;
};

// A workspace for one thread: it allocates nothing after the largest segment.
class SegmentLineariser {
 public:
  explicit SegmentLineariser(VectorWidth width = WidestVectors())
      : reprojection_(width), inertial_(width), elimination_(width) {}

  // Linearises the inliers, all inertial factors and the weak priors of
  // weak_priors.h at the segment's states, the selection's landmarks and
  // theta0, and eliminates everything but theta. The position of keyframe
  // gauge_keyframe and its rotation about gravity are held constant. `motions`
  // and `order` are those of the segment. The result is valid until the next
  // call.
  const LinearisedSegment& Eliminate(const Rig& rig,
                                     const Calibration& theta0,
                                     const MotionSegment& segment,
                                     const KeyframeMotions& motions,
                                     const InlierSelection& selection,
                                     const ObservationOrder& order,
                                     int gauge_keyframe);

  // Eliminates without priors on states, down to theta and the states of the
  // first and the last keyframe, in this order: information about D + 30
  // unknowns. The motion of a second IMU is eliminated at the ends as well. The
  // position of both keyframes together and their rotation about
  // gravity are free.
  const LinearisedSegment& EliminateToEnds(const Rig& rig,
                                           const Calibration& theta0,
                                           const MotionSegment& segment,
                                           const KeyframeMotions& motions,
                                           const InlierSelection& selection,
                                           const ObservationOrder& order);

  // Linearises the same factors without eliminating them; a baseline for
  // benchmarks.
  void LineariseAlone(const Rig& rig,
                      const Calibration& theta0,
                      const MotionSegment& segment,
                      const KeyframeMotions& motions,
                      const InlierSelection& selection,
                      const ObservationOrder& order);

 private:
  template <typename Use>
  void LineariseViews(const Rig& rig,
                      const Calibration& theta0,
                      const MotionSegment& segment,
                      const KeyframeMotions& motions,
                      const Use& use);
  void LineariseLinks(const Rig& rig,
                      const Calibration& theta0,
                      const MotionSegment& segment);
  // Adds all factors but the links, for a chain with this many kept unknowns.
  void StartChain(const Rig& rig,
                  const Calibration& theta0,
                  const MotionSegment& segment,
                  const KeyframeMotions& motions,
                  const InlierSelection& selection,
                  const ObservationOrder& order,
                  int kept);

  ReprojectionBatch reprojection_;
  LinkBatch inertial_;
  ChainElimination elimination_;
  LinearisedSegment result_;

  InlierTracks inliers_;
  std::vector<LandmarkRows> cameras_;
  std::vector<double> rows_;  // of one run
  LinksOfImus links_;
  LinkTransitions transitions_;
};

}  // namespace selfcal
