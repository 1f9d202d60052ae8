// Uncertainty of the readings of an IMU between its samples.
//
// Noise is that of the samples: for a sensor with one sample every `period`, a
// sample has the variance density^2 / period, whatever the distance of its
// neighbours. Readings are interpolated linearly, so that a sample represents
// half of the steps on either side; over a step of H between steps of H_0 and
// H_1 the integral of the noise has the variance
//   density^2 H (H + (H_0 + H_1) / 2) / (2 period),
// which is density^2 H if all steps are equal.
//
// Over a gap, the signal itself is unknown: the error of the mean of a linear
// interpolation is about -H^2 / 12 of the second derivative. That is estimated
// from the difference of the slope over the gap and those before and after it,
// each over the length of the gap; the larger of the two is used, of all axes
// together.
//
// Pure, callable from any thread; allocates only for the gaps of a segment that
// has irregular steps.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "core/model/rig.h"
#include "core/model/segment.h"

namespace selfcal {

// A step that exceeds the usual one by this factor has room for another sample:
// a gap.
inline constexpr double kGapRatio = 1.6;

// Number and time range of the samples beyond an interval that affect it: as
// neighbours, for the usual step, and for the signal about a gap.
inline constexpr int kSamplesBeyond = 8;
inline constexpr std::int64_t kReachBeyond_ns = 250'000'000;

struct SampleGaps {
  int count = 0;
  double longest_s = 0;  // 0 without a gap
};

// Gaps relative to the median step.
SampleGaps FindGaps(std::span<const ImuSample> samples);

// Densities of a step: over a part h of it, the mean error of a raw reading has
// the variance density^2 / h, on each axis.
struct StepDensities {
  double gyro = 0;   // [rad/s/sqrt(Hz)]
  double accel = 0;  // [m/s^2/sqrt(Hz)]
};

// Steps of one interval, with room for kSamplesBeyond on either side.
class Sampling {
 public:
  // The samples must outlive this.
  Sampling(std::span<const ImuSample> samples,
           std::int64_t t0_ns,
           std::int64_t t1_ns,
           const ImuNoise& noise);

  // Densities of the step that ends with sample `next`; before the first and
  // after the last sample, those of regular steps.
  StepDensities At(std::size_t next) const {
    return regular_ ? StepDensities{noise_.gyro_noise_density,
                                    noise_.accel_noise_density}
                    : OfIrregular(next);
  }

 private:
  StepDensities OfIrregular(std::size_t next) const;
  double Step(std::size_t next) const;

  std::span<const ImuSample> samples_;
  const ImuNoise& noise_;
  bool regular_ = true;
  double period_s_ = 0;  // unless regular
};

}  // namespace selfcal
