// The whitened, linearised factors of a segment, handed to the elimination
// (section IV-A, steps 1 and 2). Pure, deterministic for one width of vectors.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/elimination/chain_elimination.h"
#include "core/factor/inertial_batch.h"
#include "core/factor/keyframe_motion.h"
#include "core/factor/reprojection_batch.h"
#include "core/information/inliers.h"
#include "core/information/observation_order.h"
#include "core/model/calibration.h"
#include "core/model/rig.h"
#include "core/model/segment.h"

namespace selfcal {

// Information about the states of the first keyframe of a chain, in the sizes
// of weak_priors.h: about its velocity and biases; and about what nothing
// shows, the gauge, which is held.
ChainStateMatrix MotionPrior();
ChainStateMatrix GaugePrior(const KeyframeState& x);

struct LinearisedSegment {
  SharedInformation theta;  // of all of its tangent, in its units
  // Root mean square of the whitened inertial residuals, by kind (rotation,
  // velocity, position, b_a, b_g).
  std::vector<double> inertial_rms;
};

// A workspace for one thread: nothing is allocated once it has seen the largest
// segment.
class SegmentLineariser {
 public:
  explicit SegmentLineariser(VectorWidth width = WidestVectors())
      : reprojection_(width), inertial_(width), elimination_(width) {}

  // Linearises the inliers, all inertial factors and the weak priors of
  // weak_priors.h at the segment's states, the selection's landmarks and
  // theta0, and eliminates everything but theta. The keyframe gauge_keyframe is
  // held in position and in rotation about gravity. `motions` and `order` are
  // those of the segment. The result is good until the next call.
  const LinearisedSegment& Eliminate(const Rig& rig,
                                     const Calibration& theta0,
                                     const MotionSegment& segment,
                                     const KeyframeMotions& motions,
                                     const InlierSelection& selection,
                                     const ObservationOrder& order,
                                     int gauge_keyframe);

  // The same without priors on states, down to theta and the states of the
  // first and the last keyframe, in this order: information about D + 30
  // unknowns, of which position and rotation about gravity of both keyframes
  // together are free.
  const LinearisedSegment& EliminateToEnds(const Rig& rig,
                                           const Calibration& theta0,
                                           const MotionSegment& segment,
                                           const KeyframeMotions& motions,
                                           const InlierSelection& selection,
                                           const ObservationOrder& order);

  // The same factors without their elimination: what a benchmark compares with.
  void LineariseAlone(const Rig& rig,
                      const Calibration& theta0,
                      const MotionSegment& segment,
                      const KeyframeMotions& motions,
                      const InlierSelection& selection,
                      const ObservationOrder& order);

 private:
  void FindTracks(const MotionSegment& segment,
                  const InlierSelection& selection,
                  const ObservationOrder& order);
  template <typename Use>
  void LineariseViews(const Rig& rig,
                      const Calibration& theta0,
                      const MotionSegment& segment,
                      const KeyframeMotions& motions,
                      const Use& use);
  void LineariseLinks(const Rig& rig,
                      const Calibration& theta0,
                      const MotionSegment& segment);
  // All factors but those of links, for a chain with so many kept unknowns.
  void StartChain(const Rig& rig,
                  const Calibration& theta0,
                  const MotionSegment& segment,
                  const KeyframeMotions& motions,
                  const InlierSelection& selection,
                  const ObservationOrder& order,
                  int kept);

  ReprojectionBatch reprojection_;
  InertialBatch inertial_;
  ChainElimination elimination_;
  LinearisedSegment result_;

  ObservationRuns runs_;
  std::vector<double> points_;  // homogeneous p_G of the landmarks, 4 each
  std::vector<int> camera_sizes_;
  // The inliers as the elimination counts them: by landmark.
  std::vector<int> tracks_, track_keyframes_;
  std::vector<int> factor_of_observation_;  // -1 for what is no inlier
  std::vector<int> factors_;                // by view
  std::vector<double> rows_;                // of one run
  std::vector<InertialLinkStates> links_;
  std::vector<InertialNoiseRoot> roots_;
  std::vector<InertialTransition> transitions_;
};

}  // namespace selfcal
