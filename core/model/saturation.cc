#include "core/model/saturation.h"

#include <algorithm>
#include <vector>

namespace selfcal {
namespace {

// False for what is not finite, which is left to the validation.
bool IsSaturated(const ImuSample& sample, const ImuFullScale& full_scale) {
  return sample.gyro.allFinite() && sample.accel.allFinite() &&
         (sample.gyro.cwiseAbs().maxCoeff() >= full_scale.gyro_radps ||
          sample.accel.cwiseAbs().maxCoeff() >= full_scale.accel_mps2);
}

}  // namespace

std::size_t CountSaturatedReadings(const MotionSegment& segment,
                                   const ImuFullScale& full_scale) {
  return static_cast<std::size_t>(std::count_if(
      segment.imu.begin(), segment.imu.end(), [&](const ImuSample& sample) {
        return IsSaturated(sample, full_scale);
      }));
}

bool IsTooSaturated(const MotionSegment& segment, std::size_t count) {
  return static_cast<double>(count) >
         kMaxSaturatedFraction * static_cast<double>(segment.imu.size());
}

void RemoveSaturatedReadings(const ImuFullScale& full_scale,
                             MotionSegment* segment) {
  std::erase_if(segment->imu, [&](const ImuSample& sample) {
    return IsSaturated(sample, full_scale);
  });
}

}  // namespace selfcal
