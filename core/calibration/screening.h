// Which landmarks and observations a round of the calibration stands on.
//
// Decided anew at every estimate, as a function of that estimate only: what was
// dropped before may come back, and two ways to one optimum end with the same
// set. Where that goes on for long, the estimate and what it stands on chase
// each other: a track has two minima and changes over, or the landmarks of a
// device at rest support the very motion that gives them parallax. Then the
// history decides, so that it ends. Pure, any thread.
#pragma once

#include <cstddef>
#include <vector>

#include "core/calibration/calibrate.h"
#include "core/calibration/problem.h"
#include "core/calibration/triangulate.h"
#include "core/factor/keyframe_motion.h"
#include "core/model/calibration.h"
#include "core/model/rig.h"

namespace selfcal {

// With two observations an error along the epipolar line cannot be seen.
inline constexpr std::size_t kMinTrackObservations = 3;
// In robust standard deviations, from the median of all residuals; never less
// than so many times the pixel sigma of the rig.
inline constexpr double kOutlierGate = 5.0;
// An observation predicted near to the border of the image weighs less, and
// nothing below the nearer of these [pixel sigmas]: its own noise decided
// whether it was seen there, so that those that were lean inwards, and with
// them focal length and distortion. The prediction decides, since it is not
// correlated with the residuals.
inline constexpr double kBorderBegin = 2.0;
inline constexpr double kBorderEnd = 4.0;
// A landmark of which more than this is outlying is no landmark.
inline constexpr double kMaxOutlierFraction = 0.5;

// A landmark is dropped where its inverse depth is less certain than this part
// of the median inverse depth of the scene: it has next to no parallax, as all
// landmarks of a device at rest. Compared with the scene, not with itself: the
// latter keeps of two such landmarks the one that noise moved nearer. From half
// of that on its weight falls to zero, so that one at the limit makes no
// difference: else it may come and go for ever.
inline constexpr double kMaxDepthUncertainty = 0.5;

// After so many screenings, each from the one before, weights only fall, and a
// track leaves a minimum only for a lower one.
inline constexpr int kFreeScreenings = 10;

struct ScreenedLandmark {
  int track = 0;  // index into CalibrationProblem::tracks
  LandmarkPlace place;
  // In (0, 1], on all that the landmark contributes.
  double weight = 1;
  std::vector<UsedObservation> used;
};

struct Screening {
  RobustLoss loss;  // with the gate of this estimate
  std::vector<ScreenedLandmark> landmarks;
  int landmarks_dropped = 0;
  int observations = 0;  // used
  int observations_dropped = 0;
  int screenings = 1;  // that led to this one
  double track_noise_factor = 1;
};

// Multiplies the weights of all landmarks.
void ScaleWeights(double factor, std::vector<ScreenedLandmark>* landmarks);

// Takes the pixel errors for so many times larger (track_noise.h), instead of
// what the factor was before.
void SetTrackNoise(double factor, Screening* screening);

struct ReprojectionStatistics {
  double rms_px = 0;     // of the residual norms of what is used
  double median_px = 0;  // of all observations of these tracks that project
};

// Tracks are triangulated from their observations alone; but those that, where
// `before` has them, lie within its gate with all of their observations, are
// taken from there: the outcome is the same, much sooner. The track noise is
// that of `before`.
Screening ScreenLandmarks(const Rig& rig,
                          const Calibration& theta,
                          const CalibrationProblem& problem,
                          const std::vector<KeyframeState>& keyframes,
                          const KeyframeMotions& motions,
                          const CalibrateOptions& options,
                          const Screening* before);

// Brings every landmark to the minimum of what is used of its track. With
// little parallax that is somewhere else than the minimum of the whole track,
// by which it was screened, and the solver is to linearise at a minimum.
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
