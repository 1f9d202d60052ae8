// Weights a calibration by the noise that its residuals show: the correlation
// of pixel errors along tracks (track_noise.h) and the noise scales
// (noise_scales.h).
#pragma once

#include <vector>

#include "core/calibration/calibrate.h"
#include "core/calibration/descent.h"
#include "core/calibration/noise_scale.h"
#include "core/calibration/working_point.h"
#include "core/model/rig.h"

namespace selfcal {

// All arguments must outlive it.
class NoiseWeighting {
 public:
  // `stated`: the rig with the noise that it states.
  NoiseWeighting(const Rig& stated,
                 const CalibrateOptions& options,
                 WorkingPoint* point,
                 Descent* descent)
      : stated_(stated), options_(options), point_(point), descent_(descent) {}

  // Measures the noise at a minimum, and weights by it, which moves the minimum
  // slightly, and thereby the noise: repeated until the weights are unchanged.
  // Does nothing if the descent has not converged. Returns false if the
  // calibration ends without a result.
  bool Reweight();

  // Relative to the noise that the rig states, with the weights in `used`.
  std::vector<NoiseScale> ScalesOfStated() const;

 private:
  bool WeightByTracks();
  void EstimateScales();
  // The noise that residuals show, relative to that by which `weights` weights
  // them; at most 1.
  double ResidualsTo(const Rig& weights) const;

  const Rig& stated_;
  const CalibrateOptions& options_;
  WorkingPoint* point_;
  Descent* descent_;
  double track_noise_ = 0;          // as TrackNoiseFactor
  std::vector<NoiseScale> scales_;  // relative to the noise of the weights
};

}  // namespace selfcal
