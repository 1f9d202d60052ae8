// The rig that `rig create` sends: from a file or a VI-map, with what the
// command line overrides.
#pragma once

#include <absl/status/statusor.h>

#include <optional>
#include <string>
#include <vector>

#include "selfcal/v1/rig.pb.h"

namespace selfcal::client {

struct RigInput {
  std::string file;    // proto3 JSON of selfcal.v1.Rig; "-" is stdin
  std::string vi_map;  // or a VI-map
  std::optional<std::string> id;
  std::optional<double> pixel_sigma_px;
  std::optional<double> gyro_noise;
  std::optional<double> accel_noise;
  std::optional<double> gyro_bias_walk;
  std::optional<double> accel_bias_walk;
  std::optional<double> gravity_mps2;
  std::optional<std::string> selection;  // as SelectionText()
  std::optional<int> table_size;
  std::optional<double> min_gain_nats;
  std::optional<double> retrigger_fraction;
  bool reweight_noise = false;
  std::optional<double> table_max_age_s;
  std::optional<double> min_interval_s;
  std::optional<double> calibration_max_age_s;
  std::vector<std::string> fixed;
  bool estimate_time_offset = false;
};

// INVALID_ARGUMENT and NOT_FOUND for what cannot be read, with the file's name.
// The values are judged by the daemon.
absl::StatusOr<v1::Rig> ReadRig(const RigInput& input);

// "tables", "joint-d", "joint-a", "joint-e".
std::string SelectionText(v1::Rig::Selection selection);

// proto3 JSON of a rig; unknown fields are errors.
absl::StatusOr<v1::Rig> ParseRig(const std::string& json);

}  // namespace selfcal::client
