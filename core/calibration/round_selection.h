// The basis of a round of a calibration: the motions about the keyframes,
// the landmarks and observations with their weights, and the whitening of the
// inertial links. All of it follows from an estimate, and is fixed until the
// selection is repeated at another one.
#pragma once

#include <vector>

#include "core/calibration/problem.h"
#include "core/calibration/robust_loss.h"
#include "core/calibration/screening.h"
#include "core/factor/inertial.h"
#include "core/factor/keyframe_motion.h"
#include "core/model/calibration.h"
#include "core/model/rig.h"

namespace selfcal {

class RoundSelection {
 public:
  // Each selection finds the gate of the loss.
  explicit RoundSelection(const RobustLoss& loss) : loss_(loss) {}

  // Repeats the selection at an estimate; afresh: regardless of the present
  // one.
  void Select(const Rig& rig,
              const Calibration& theta,
              const CalibrationProblem& problem,
              const std::vector<KeyframeState>& keyframes,
              bool afresh);

  // The scale of the loss, from the next selection on.
  void SetLossScale(double scale) { loss_.scale = scale; }
  // Weights the present selection and the next ones by a track noise factor.
  void SetTrackNoiseFactor(double factor);
  double track_noise_factor() const { return track_noise_factor_; }

  const KeyframeMotions& motions() const { return motions_; }
  const Screening& screening() const { return screening_; }
  Screening& screening() { return screening_; }
  const std::vector<InertialMatrix>& whitening() const { return whitening_; }

 private:
  RobustLoss loss_;
  double track_noise_factor_ = 1;
  KeyframeMotions motions_;
  Screening screening_;
  std::vector<InertialMatrix> whitening_;
};

}  // namespace selfcal
