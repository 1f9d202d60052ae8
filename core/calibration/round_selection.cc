#include "core/calibration/round_selection.h"

#include "core/calibration/chain_thetas.h"
#include "core/calibration/theta_information.h"

namespace selfcal {

void RoundSelection::Select(const Rig& rig,
                            const Calibration& theta,
                            const CalibrationProblem& problem,
                            const std::vector<KeyframeState>& keyframes,
                            bool afresh) {
  MeasureMotions(rig, theta, problem, keyframes, &motions_);
  screening_ = ScreenLandmarks(rig,
                               theta,
                               problem,
                               keyframes,
                               motions_,
                               loss_,
                               afresh ? nullptr : &screening_);
  RefineOnWhatIsUsed(rig, theta, problem, keyframes, motions_, &screening_);
  SetTrackNoise(track_noise_factor_, &screening_);
  whitening_ =
      WhitenInertialLinks(rig, ChainThetas(theta, problem), problem, keyframes);
}

void RoundSelection::SetTrackNoiseFactor(double factor) {
  track_noise_factor_ = factor;
  SetTrackNoise(factor, &screening_);
}

}  // namespace selfcal
