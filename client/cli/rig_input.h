// The rig that `rig create` sends: from a file, a VI-map or the files of
// another tool, with what the command line overrides.
#pragma once

#include <absl/status/statusor.h>

#include <optional>
#include <string>
#include <vector>

#include "client/formats/format.h"
#include "selfcal/v1/rig.pb.h"

namespace selfcal::client {

struct RigInput {
  // One with proto3 JSON of selfcal.v1.Rig, "-" is stdin; or those of `from`.
  std::vector<std::string> files;
  std::string from;    // a format of client/formats
  std::string vi_map;  // or a VI-map
  std::optional<double> imu_rate_hz;
  bool strict = false;  // nothing of `from` may be lost
  std::optional<std::string> id;
  std::optional<double> pixel_sigma_px;
  std::optional<double> gyro_noise;
  std::optional<double> accel_noise;
  std::optional<double> gyro_bias_walk;
  std::optional<double> accel_bias_walk;
  std::optional<double> gravity_mps2;
  std::optional<std::string> imu;  // a grade, as ParseImuGrade() reads it
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
// The values are judged by the daemon. Adds what files of another tool have and
// selfcal has not.
absl::StatusOr<v1::Rig> ReadRig(const RigInput& input,
                                std::vector<Loss>* losses);

// "tables", "joint-d", "joint-a", "joint-e".
std::string SelectionText(v1::Rig::Selection selection);

// proto3 JSON of a rig; unknown fields are errors.
absl::StatusOr<v1::Rig> ParseRig(const std::string& json);

}  // namespace selfcal::client
