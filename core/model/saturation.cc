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

std::size_t CountSaturatedReadings(std::span<const ImuSample> samples,
                                   const ImuFullScale& full_scale) {
  return static_cast<std::size_t>(std::count_if(
      samples.begin(), samples.end(), [&](const ImuSample& sample) {
        return IsSaturated(sample, full_scale);
      }));
}

bool IsTooSaturated(std::span<const ImuSample> samples, std::size_t count) {
  return static_cast<double>(count) >
         kMaxSaturatedFraction * static_cast<double>(samples.size());
}

void RemoveSaturatedReadings(const ImuFullScale& full_scale,
                             std::vector<ImuSample>* samples) {
  std::erase_if(*samples, [&](const ImuSample& sample) {
    return IsSaturated(sample, full_scale);
  });
}

}  // namespace selfcal
