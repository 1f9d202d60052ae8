// Selects the landmarks and observations that a round of the calibration uses.
//
// The selection is repeated at every estimate, as a function of that estimate
// only: dropped landmarks may return, and two paths to one optimum end with the
// same set. If that continues for long, the estimate and its selection follow
// each other: a track has two minima and alternates, or the landmarks of a
// device at rest support the very motion that gives them parallax. Then the
// history decides, so that the process terminates. Pure, callable from any
// thread.
#pragma once

#include <cstddef>
#include <vector>

#include "core/calibration/problem.h"
#include "core/calibration/robust_loss.h"
#include "core/calibration/triangulate.h"
#include "core/factor/keyframe_motion.h"
#include "core/model/calibration.h"
#include "core/model/rig.h"

namespace selfcal {

// Two observations leave an error along the epipolar line unobservable.
inline constexpr std::size_t kMinTrackObservations = 3;
// Outlier gate in robust standard deviations, estimated from the median of all
// residuals; at least this many times the pixel sigma of the rig.
inline constexpr double kOutlierGate = 5.0;
// The weight of an observation predicted near the border of the image is
// reduced between these distances [pixel sigmas], and zero below the smaller:
// near the border its own noise decides whether it is observed, so that the
// observed ones are biased inwards, and with them focal length and distortion.
// The weight depends on the prediction, since it is not correlated with the
// residuals. The rays of a camera may end within its image, at the largest
// radius: d sigmas before that end, a ray is only 2 d of its own sigmas away
// from the last one, and a step of theta takes it out of the model and back.
inline constexpr double kBorderBegin = 2.0;
inline constexpr double kBorderEnd = 4.0;
// A landmark with a larger fraction of outliers is dropped.
inline constexpr double kMaxOutlierFraction = 0.5;

// A landmark is dropped if its inverse depth is less certain than this fraction
// of the median inverse depth of the scene: it has almost no parallax, like all
// landmarks of a device at rest. The comparison is with the scene, not with the
// landmark itself: the latter would keep, of two such landmarks, the one that
// noise moved nearer. From half of the limit on, the weight decreases to zero,
// so that a landmark at the limit makes no difference; otherwise it could
// alternate for ever.
inline constexpr double kMaxDepthUncertainty = 0.5;

// After this many screenings, each based on the previous one, weights can only
// decrease, and a track leaves a minimum only for a lower one.
inline constexpr int kFreeScreenings = 10;

struct ScreenedLandmark {
  int track = 0;  // index into CalibrationProblem::tracks
  LandmarkPosition position;
  // Weight in (0, 1] of all factors of the landmark.
  double weight = 1;
  std::vector<UsedObservation> used;
};

struct Screening {
  RobustLoss loss;  // with the gate for this estimate
  std::vector<ScreenedLandmark> landmarks;
  int landmarks_dropped = 0;
  int observations = 0;  // used
  int observations_dropped = 0;
  int screenings = 1;  // number of screenings up to this one
  double track_noise_factor = 1;
};

// Multiplies the weights of all landmarks.
void ScaleWeights(double factor, std::vector<ScreenedLandmark>* landmarks);

// Scales the pixel errors by this factor (track_noise.h), which replaces the
// previous one.
void SetTrackNoise(double factor, Screening* screening);

struct ReprojectionStatistics {
  double rms_px = 0;     // of the residual norms of used observations
  double median_px = 0;  // of all observations of these tracks that project
};

// Triangulates tracks from their observations alone. However, a track that is
// in `before`, with all of its observations within the gate there, starts from
// the position there: the result is the same, at a much lower cost. The track
// noise is that of `before`. The gate of the loss is found here.
Screening ScreenLandmarks(const Rig& rig,
                          const Calibration& theta,
                          const CalibrationProblem& problem,
                          const std::vector<KeyframeState>& keyframes,
                          const KeyframeMotions& motions,
                          const RobustLoss& loss,
                          const Screening* before);

// Moves every landmark to the minimum over the used observations of its track.
// With little parallax that differs from the minimum of the whole track, by
// which it was screened, and the solver should linearise at a minimum.
void RefineOnWhatIsUsed(const Rig& rig,
                        const Calibration& theta,
                        const CalibrationProblem& problem,
                        const std::vector<KeyframeState>& keyframes,
                        const KeyframeMotions& motions,
                        Screening* screening);

ReprojectionStatistics MeasureReprojection(
    const Rig& rig,
    const Calibration& theta,
    const CalibrationProblem& problem,
    const std::vector<KeyframeState>& keyframes,
    const KeyframeMotions& motions,
    const std::vector<ScreenedLandmark>& landmarks);

}  // namespace selfcal
