// Rigs that state their noise wrongly: what the experiments on it share.
#pragma once

#include <string>
#include <vector>

#include "core/calibration/calibrate.h"
#include "core/calibration/noise_scale.h"
#include "test/evaluation/datasets.h"

namespace selfcal {

inline std::vector<NoiseKind> AllKinds() {
  std::vector<NoiseKind> kinds;
  for (int i = 0; i < kNoiseKinds; ++i) {
    kinds.push_back(static_cast<NoiseKind>(i));
  }
  return kinds;
}

// A device whose sensors have other noise than the hand-held one.
inline EvaluatedDevice WithNoise(double inertial_factor) {
  EvaluatedDevice device = MakeDevice();
  for (const NoiseKind kind : AllKinds()) {
    if (kind != NoiseKind::kPixel) {
      ScaleNoise(kind, inertial_factor, &device.rig);
    }
  }
  return device;
}

// What the rig states, in parts of the truth.
struct Belief {
  std::string name;
  std::vector<NoiseKind> kinds;
  double factor = 1;
};

inline Rig Believe(Rig rig, const Belief& belief) {
  for (const NoiseKind kind : belief.kinds) {
    ScaleNoise(kind, belief.factor, &rig);
  }
  return rig;
}

inline std::vector<NoiseScale> OverTruth(const CalibrationResult& result,
                                         const Rig& stated,
                                         const Rig& truth) {
  std::vector<NoiseScale> factors = result.noise_scales;
  for (NoiseScale& factor : factors) {
    factor.factor *= NoiseOf(factor.kind, stated) / NoiseOf(factor.kind, truth);
  }
  return factors;
}

}  // namespace selfcal
