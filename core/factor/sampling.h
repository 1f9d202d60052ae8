// What is not known of the readings of an IMU between its samples.
//
// Noise comes with each sample: of a sensor that takes one every `period`, a
// sample has the variance density^2 / period, however far its neighbours are.
// Readings are joined by straight lines, so that a sample stands for half of
// the steps on either side; over a step of H between steps of H_0 and H_1 the
// integral of the noise has the variance
//   density^2 H (H + (H_0 + H_1) / 2) / (2 period),
// which is density^2 H where samples come at equal steps.
//
// Over a gap, the signal itself is not known: a line misses its mean by about
// -H^2 / 12 of its second derivative. That is estimated by how the slope over
// the gap differs from those before and after it, over as much time as the gap
// itself; the larger counts, of all axes together.
//
// Pure, any thread; allocates nothing, but for the gaps of a segment that has
// irregular steps.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "core/model/rig.h"
#include "core/model/segment.h"

namespace selfcal {

// A step over the usual one by this factor has room for another sample: a gap.
inline constexpr double kGapRatio = 1.6;

// Samples of a segment, and how far they reach beyond an interval, that tell
// all there is to know of it: of neighbours, of the usual step, of the signal
// about a gap.
inline constexpr int kSamplesBeyond = 8;
inline constexpr std::int64_t kReachBeyond_ns = 250'000'000;

struct SampleGaps {
  int count = 0;
  double longest_s = 0;  // 0 without a gap
};

// Against the median step.
SampleGaps FindGaps(std::span<const ImuSample> samples);

// Of a step: over a part h of it, the mean error of a raw reading has the
// variance density^2 / h, on each axis.
struct StepDensities {
  double gyro = 0;   // [rad/s/sqrt(Hz)]
  double accel = 0;  // [m/s^2/sqrt(Hz)]
};

// The steps of one interval, with room for kSamplesBeyond on either side.
class Sampling {
 public:
  // The samples must outlive this.
  Sampling(std::span<const ImuSample> samples,
           std::int64_t t0_ns,
           std::int64_t t1_ns,
           const ImuNoise& noise);

  // Of the step that ends with sample `next`; before the first and after the
  // last, as of regular steps.
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
