#include "client/cli/rig_input.h"

#include <fmt/format.h>
#include <google/protobuf/util/json_util.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <iostream>
#include <iterator>
#include <utility>

#include "client/cli/camera_choice.h"
#include "client/cli/component_settings.h"
#include "client/cli/extrinsics_input.h"
#include "client/cli/foreign_files.h"
#include "client/cli/imu_preset_choice.h"
#include "client/import/read_file.h"
#include "client/import/vi_map.h"
#include "core/model/imu_grades.h"
#include "core/model/imu_presets.h"
#include "core/model/noise_density.h"
#include "proto/convert.h"
#include "proto/nearest_word.h"
#include "proto/resource_names.h"

namespace selfcal::client {
namespace {

// Standard input is "-".
absl::StatusOr<std::string> ReadInput(const std::string& name) {
  if (name != "-") return ReadFile(name);
  return std::string(std::istreambuf_iterator<char>(std::cin), {});
}

// A rig that is not selfcal's own has no groups: the daemon sets the default.
v1::Rig WithoutGroups(v1::Rig rig) {
  rig.clear_groups();
  return rig;
}

absl::StatusOr<v1::Rig> ReadForeign(const RigInput& input,
                                    std::vector<Loss>* losses) {
  const auto files = ReadTextFiles(input.files);
  if (!files.ok()) return files.status();
  auto imported =
      ImportRig(input.from, *files, {.imu_rate_hz = input.imu_rate_hz});
  if (!imported.ok()) return imported.status();
  *losses = imported->losses;
  const absl::Status posed =
      SetExtrinsics(input.extrinsics, &imported->rig, losses);
  if (!posed.ok()) return posed;
  if (!input.cameras.empty()) {
    const absl::Status kept =
        KeepCameras(input.cameras, &imported->rig, losses);
    if (!kept.ok()) return kept;
  }
  if (input.strict && ChangesPrediction(*losses)) {
    return absl::InvalidArgumentError(
        "no rig was created: --strict is set, and the conversion has losses");
  }
  return WithoutGroups(ToProto(imported->rig));
}

absl::StatusOr<v1::Rig> ReadBase(const RigInput& input,
                                 std::vector<Loss>* losses) {
  if (input.base) return WithoutGroups(ToProto(*input.base));
  if (!input.from.empty()) return ReadForeign(input, losses);
  if (!input.vi_map.empty()) {
    absl::StatusOr<ViMapRecording> recording = ReadViMap(input.vi_map, {});
    if (!recording.ok()) return recording.status();
    if (!input.cameras.empty()) {
      const absl::Status kept =
          KeepCameras(input.cameras, &recording->rig, losses);
      if (!kept.ok()) return kept;
    }
    return WithoutGroups(ToProto(recording->rig));
  }
  if (!input.cameras.empty()) {
    return absl::InvalidArgumentError(
        "--cameras: is for --from and --vi-map; a file of selfcal has its "
        "cameras as they are");
  }
  if (input.files.size() != 1) {
    return absl::InvalidArgumentError(
        "name one file; for the files of another tool, name the tool with "
        "--from");
  }
  const std::string& file = input.files[0];
  const auto json = ReadInput(file);
  if (!json.ok()) return json.status();
  auto rig = ParseRig(*json);
  if (!rig.ok()) {
    return absl::InvalidArgumentError(
        fmt::format("{}: {}",
                    file,
                    std::string(rig.status().message().data(),
                                rig.status().message().size())));
  }
  return rig;
}

absl::Status SetSelection(const std::string& text, v1::Rig* rig) {
  std::vector<std::string> known;
  for (const v1::Rig::Selection selection : {v1::Rig::TABLES,
                                             v1::Rig::JOINT_D,
                                             v1::Rig::JOINT_A,
                                             v1::Rig::JOINT_E}) {
    if (SelectionText(selection) == text) {
      rig->set_selection(selection);
      return absl::OkStatus();
    }
    known.push_back(SelectionText(selection));
  }
  return absl::InvalidArgumentError(
      fmt::format("--selection: '{}' must be one of {}{}",
                  text,
                  fmt::join(known, ", "),
                  DidYouMean(text, known)));
}

// Puts the tolerances before those of the file, which are of single components
// and take precedence.
void SetImuTolerances(ImuGrade grade, const std::string& imu, v1::Rig* rig) {
  google::protobuf::RepeatedPtrField<v1::ComponentSetting> settings;
  for (const ComponentSetting& tolerance : ImuTolerances(grade, imu)) {
    v1::ComponentSetting* added = settings.Add();
    added->set_pattern(tolerance.pattern);
    added->set_value(tolerance.value);
  }
  settings.MergeFrom(rig->prior_sigmas());
  *rig->mutable_prior_sigmas() = std::move(settings);
}

absl::StatusOr<ImuGrade> ReadGrade(const std::string& text) {
  if (const auto grade = ParseImuGrade(text)) return *grade;
  return absl::InvalidArgumentError(fmt::format(
      "--imu: '{}' must be one of consumer, factory-calibrated, unknown{}",
      text,
      DidYouMean(text, {"consumer", "factory-calibrated", "unknown"})));
}

// Noise and full scale, as those of a first IMU.
v1::Rig ToProto(const ImuPreset& preset) {
  Rig rig;
  rig.imu_noise = preset.noise;
  rig.imu_full_scale = preset.full_scale;
  return selfcal::ToProto(rig);
}

// Noise and full scale of the preset replace those of the file.
absl::StatusOr<const ImuPreset*> SetImuPreset(const std::string& name,
                                              v1::Rig* rig) {
  const ImuPreset* const preset = FindImuPreset(name);
  if (preset == nullptr) return UnknownImuPreset("--imu-preset: ", name);
  const v1::Rig values = ToProto(*preset);
  *rig->mutable_imu_noise() = values.imu_noise();
  *rig->mutable_imu() = values.imu();
  return preset;
}

// The tolerances are those of the grade, or of the preset's.
absl::Status SetImu(const RigInput& input, v1::Rig* rig) {
  std::optional<ImuGrade> grade;
  if (input.imu_preset) {
    const auto preset = SetImuPreset(*input.imu_preset, rig);
    if (!preset.ok()) return preset.status();
    grade = (*preset)->grade;
  }
  if (input.imu) {
    const auto given = ReadGrade(*input.imu);
    if (!given.ok()) return given.status();
    grade = *given;
  }
  if (grade) SetImuTolerances(*grade, "imu", rig);
  return absl::OkStatus();
}

// Noise, full scale and tolerances of the second IMU.
absl::Status SetSecondImu(const RigInput& input, v1::Rig* rig) {
  if (!input.imu1_preset) return absl::OkStatus();
  constexpr char kFlag[] = "--imu1-preset: ";
  if (!rig->factory().has_imu1()) {
    return absl::InvalidArgumentError(
        fmt::format("{}the rig has no second IMU: state its pose as "
                    "factory.imu1, or in imu1.yaml of --from kalibr",
                    kFlag));
  }
  const ImuPreset* const preset = FindImuPreset(*input.imu1_preset);
  if (preset == nullptr) return UnknownImuPreset(kFlag, *input.imu1_preset);
  const v1::Rig values = ToProto(*preset);
  *rig->mutable_imu1_noise() = values.imu_noise();
  *rig->mutable_imu1() = values.imu();
  SetImuTolerances(preset->grade, "imu1", rig);
  return absl::OkStatus();
}

// A density, or that of readings with a standard deviation. The command line
// has checked that only one is given, with the rate.
std::optional<double> Density(const std::optional<double>& density,
                              const std::optional<double>& rms,
                              const RigInput& input) {
  if (rms) return NoiseDensity(*rms, *input.imu_rate_hz);
  return density;
}

void SetNoise(const RigInput& input, v1::Rig* rig) {
  v1::ImuNoise noise = rig->imu_noise();
  const auto gyro = Density(input.gyro_noise, input.gyro_noise_rms, input);
  const auto accel = Density(input.accel_noise, input.accel_noise_rms, input);
  if (gyro) noise.set_gyro_noise_density(*gyro);
  if (accel) noise.set_accel_noise_density(*accel);
  if (input.gyro_bias_walk) {
    noise.set_gyro_bias_random_walk(*input.gyro_bias_walk);
  }
  if (input.accel_bias_walk) {
    noise.set_accel_bias_random_walk(*input.accel_bias_walk);
  }
  if (gyro || accel || input.gyro_bias_walk || input.accel_bias_walk) {
    *rig->mutable_imu_noise() = noise;
  }
}

// Puts the sigmas after those of the file and the grade: they take precedence.
absl::Status AddPriorSigmas(const RigInput& input, v1::Rig* rig) {
  constexpr char kFlag[] = "--prior-sigma";
  google::protobuf::RepeatedPtrField<v1::ComponentSetting> settings;
  absl::Status status = ReadSettings(kFlag, input.prior_sigmas, &settings);
  if (status.ok()) status = NameComponents(kFlag, *rig, &settings);
  if (status.ok()) rig->mutable_prior_sigmas()->MergeFrom(settings);
  return status;
}

google::protobuf::Duration Seconds(double seconds) {
  constexpr double kMost = 1e12;  // the daemon refuses larger values anyway
  const double bounded = std::clamp(seconds, -kMost, kMost);
  google::protobuf::Duration duration;
  duration.set_seconds(static_cast<std::int64_t>(bounded));
  duration.set_nanos(static_cast<std::int32_t>(
      std::round((bounded - std::trunc(bounded)) * 1e3) * 1e6));
  return duration;
}

absl::Status AddBlocks(const std::vector<std::string>& settings, v1::Rig* rig) {
  for (const std::string& setting : settings) {
    const std::size_t equals = setting.rfind('=');
    const std::string state =
        equals == setting.npos ? "" : setting.substr(equals + 1);
    if (state != "on" && state != "off") {
      return absl::InvalidArgumentError(
          fmt::format("--block: '{}' must be NAME=on or NAME=off", setting));
    }
    v1::BlockSetting* added = rig->add_blocks();
    added->set_pattern(setting.substr(0, equals));
    added->set_state(state == "on" ? v1::BlockSetting::ON
                                   : v1::BlockSetting::OFF);
  }
  return absl::OkStatus();
}

void SetPolicy(const RigInput& input, v1::Rig* rig) {
  if (input.table_max_age_s) {
    *rig->mutable_table_max_age() = Seconds(*input.table_max_age_s);
  }
  if (input.min_interval_s) {
    *rig->mutable_recalibration_min_interval() = Seconds(*input.min_interval_s);
  }
  if (input.calibration_max_age_s) {
    *rig->mutable_calibration_max_age() = Seconds(*input.calibration_max_age_s);
  }
}

}  // namespace

std::string SelectionText(v1::Rig::Selection selection) {
  std::string text = v1::Rig::Selection_Name(selection);
  for (char& c : text) {
    c = c == '_' ? '-' : static_cast<char>(std::tolower(c));
  }
  return text;
}

absl::StatusOr<v1::Rig> ParseRig(const std::string& json) {
  v1::Rig rig;
  const auto status = google::protobuf::util::JsonStringToMessage(json, &rig);
  if (status.ok()) return rig;
  return absl::InvalidArgumentError(
      fmt::format("is not a selfcal.v1.Rig in JSON: {}", status.ToString()));
}

absl::StatusOr<v1::Rig> ReadRig(const RigInput& input,
                                std::vector<Loss>* losses) {
  absl::StatusOr<v1::Rig> rig = ReadBase(input, losses);
  if (!rig.ok()) return rig;
  if (input.id) rig->set_name(RigName(*input.id));
  if (input.pixel_sigma_px) rig->set_pixel_sigma_px(*input.pixel_sigma_px);
  if (input.gravity_mps2) rig->set_gravity_mps2(*input.gravity_mps2);
  if (input.selection) {
    const absl::Status status = SetSelection(*input.selection, &*rig);
    if (!status.ok()) return status;
  }
  if (const absl::Status status = SetImu(input, &*rig); !status.ok()) {
    return status;
  }
  const absl::Status second = SetSecondImu(input, &*rig);
  if (!second.ok()) return second;
  const absl::Status sigmas = AddPriorSigmas(input, &*rig);
  if (!sigmas.ok()) return sigmas;
  if (input.table_size) rig->set_table_size(*input.table_size);
  if (input.min_gain_nats) rig->set_min_gain_nats(*input.min_gain_nats);
  if (input.retrigger_fraction) {
    rig->set_retrigger_fraction(*input.retrigger_fraction);
  }
  if (input.reweight_noise) rig->set_reweight_noise(true);
  SetPolicy(input, &*rig);
  SetNoise(input, &*rig);
  if (input.gyro_max) rig->mutable_imu()->set_gyro_max(*input.gyro_max);
  if (input.accel_max) rig->mutable_imu()->set_accel_max(*input.accel_max);
  rig->mutable_fixed()->Add(input.fixed.begin(), input.fixed.end());
  const absl::Status status = AddBlocks(input.blocks, &*rig);
  if (!status.ok()) return status;
  if (input.estimate_time_offset) rig->set_estimate_time_offset(true);
  return rig;
}

}  // namespace selfcal::client
