// The rig that `rig create` sends: read from a file, a VI-map or the files of
// another tool, with the overrides of the command line.
#pragma once

#include <absl/status/statusor.h>

#include <optional>
#include <string>
#include <vector>

#include "client/formats/format.h"
#include "core/model/rig.h"
#include "selfcal/v1/rig.pb.h"

namespace selfcal::client {

struct RigInput {
  // One file with proto3 JSON of selfcal.v1.Rig, "-" for stdin; or the files of
  // the tool that `from` names.
  std::vector<std::string> files;
  std::string from;         // a format of client/formats
  std::string vi_map;       // folder of a VI-map, instead of files
  std::optional<Rig> base;  // instead of files: what a recording says
  std::optional<double> imu_rate_hz;
  bool strict = false;  // fail if reading `from` has losses
  // The cameras to take from `from` or `vi_map`: cam0, ...; empty: all.
  std::vector<std::string> cameras;
  std::vector<std::string> extrinsics;  // of cameras of `from`
  std::optional<std::string> id;
  std::optional<double> pixel_sigma_px;
  std::optional<double> gyro_noise;
  std::optional<double> accel_noise;
  // Standard deviation of single readings at imu_rate_hz, instead of a density.
  std::optional<double> gyro_noise_rms;   // [rad/s]
  std::optional<double> accel_noise_rms;  // [m/s^2]
  std::optional<double> gyro_bias_walk;
  std::optional<double> accel_bias_walk;
  std::optional<double> gyro_max;   // [rad/s]
  std::optional<double> accel_max;  // [m/s^2]
  std::optional<double> gravity_mps2;
  std::optional<std::string> imu;  // a grade, as ParseImuGrade() reads it
  std::optional<std::string> imu_preset;  // as FindImuPreset() finds it
  std::optional<std::string> imu1_preset;
  std::optional<std::string> selection;  // as SelectionText()
  std::optional<int> table_size;
  std::optional<double> min_gain_nats;
  std::optional<double> retrigger_fraction;
  bool reweight_noise = false;
  std::optional<double> table_max_age_s;
  std::optional<double> min_interval_s;
  std::optional<double> calibration_max_age_s;
  std::vector<std::string> prior_sigmas;  // COMPONENT=VALUE
  std::vector<std::string> fixed;
  std::vector<std::string> blocks;  // NAME=on or NAME=off
  bool estimate_time_offset = false;
};

// Reads the rig. INVALID_ARGUMENT or NOT_FOUND, with the name of the file or of
// the flag, if it cannot be read. The daemon validates the values. Appends to
// *losses what the files of another tool have and selfcal cannot express.
absl::StatusOr<v1::Rig> ReadRig(const RigInput& input,
                                std::vector<Loss>* losses);

// Returns "tables", "joint-d", "joint-a" or "joint-e".
std::string SelectionText(v1::Rig::Selection selection);

// Parses a rig from proto3 JSON; unknown fields are errors.
absl::StatusOr<v1::Rig> ParseRig(const std::string& json);

}  // namespace selfcal::client
