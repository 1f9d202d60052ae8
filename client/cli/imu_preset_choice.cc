#include "client/cli/imu_preset_choice.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <vector>

#include "core/model/imu_presets.h"
#include "proto/nearest_word.h"

namespace selfcal::client {

absl::Status UnknownImuPreset(const std::string& prefix,
                              const std::string& name) {
  std::vector<std::string> known;
  for (const ImuPreset& preset : ImuPresets()) known.emplace_back(preset.name);
  return absl::InvalidArgumentError(fmt::format("{}'{}' must be one of {}{}",
                                                prefix,
                                                name,
                                                fmt::join(known, ", "),
                                                DidYouMean(name, known)));
}

}  // namespace selfcal::client
