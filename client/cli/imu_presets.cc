// rig presets.
#include "core/model/imu_presets.h"

#include <fmt/format.h>
#include <google/protobuf/struct.pb.h>

#include <memory>
#include <numbers>
#include <string>

#include "client/cli/commands.h"
#include "client/cli/imu_preset_choice.h"

namespace selfcal::client {
namespace {

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kG_mps2 = 9.80665;

google::protobuf::Struct PresetMessage(const ImuPreset& preset) {
  google::protobuf::Struct message;
  auto& fields = *message.mutable_fields();
  const auto set_text = [&](const char* name, std::string_view text) {
    fields[name].set_string_value(std::string(text));
  };
  set_text("name", preset.name);
  set_text("part", preset.part);
  const ImuNoise& noise = preset.noise;
  fields["gyro_noise_density"].set_number_value(noise.gyro_noise_density);
  fields["accel_noise_density"].set_number_value(noise.accel_noise_density);
  fields["gyro_bias_random_walk"].set_number_value(noise.gyro_bias_random_walk);
  fields["accel_bias_random_walk"].set_number_value(
      noise.accel_bias_random_walk);
  fields["gyro_max"].set_number_value(preset.full_scale.gyro_radps);
  fields["accel_max"].set_number_value(preset.full_scale.accel_mps2);
  set_text("grade", ImuGradeName(preset.grade));
  set_text("density_source", preset.density_source);
  set_text("walk_source", preset.walk_source);
  set_text("range_source", preset.range_source);
  return message;
}

int ListPresets(const Context& context) {
  if (context.json) {
    google::protobuf::Struct message;
    auto* list = (*message.mutable_fields())["presets"].mutable_list_value();
    for (const ImuPreset& preset : ImuPresets()) {
      *list->add_values()->mutable_struct_value() = PresetMessage(preset);
    }
    context.PrintJson(message);
    return kDone;
  }
  Table table({{"preset"},
               {"gyro [mdeg/s/sqrt(Hz)]", true},
               {"accel [ug/sqrt(Hz)]", true},
               {"to [deg/s]", true},
               {"to [g]", true},
               {"grade"},
               {"part"}});
  for (const ImuPreset& preset : ImuPresets()) {
    table.Add(
        {std::string(preset.name),
         fmt::format("{:.3g}", preset.noise.gyro_noise_density / kDegree * 1e3),
         fmt::format("{:.3g}",
                     preset.noise.accel_noise_density / kG_mps2 * 1e6),
         fmt::format("{:.4g}", preset.full_scale.gyro_radps / kDegree),
         fmt::format("{:.3g}", preset.full_scale.accel_mps2 / kG_mps2),
         std::string(ImuGradeName(preset.grade)),
         std::string(preset.part)});
  }
  context.Print(table);
  return kDone;
}

int ShowPreset(const Context& context, const std::string& name) {
  const ImuPreset* const preset = FindImuPreset(name);
  if (preset == nullptr) return FailInput(UnknownImuPreset("", name));
  if (context.json) {
    context.PrintJson(PresetMessage(*preset));
    return kDone;
  }
  const ImuNoise& noise = preset->noise;
  Facts facts;
  facts.Add("preset", std::string(preset->name));
  facts.Add("part", std::string(preset->part));
  facts.Add("gyro noise",
            fmt::format("{:.4g} rad/s/sqrt(Hz)", noise.gyro_noise_density));
  facts.Add("accel noise",
            fmt::format("{:.4g} m/s^2/sqrt(Hz)", noise.accel_noise_density));
  facts.Add("source of noise", std::string(preset->density_source));
  facts.Add(
      "gyro bias walk",
      fmt::format("{:.4g} rad/s^2/sqrt(Hz)", noise.gyro_bias_random_walk));
  facts.Add("accel bias walk",
            fmt::format("{:.4g} m/s^3/sqrt(Hz)", noise.accel_bias_random_walk));
  facts.Add("source of walks", std::string(preset->walk_source));
  facts.Add("gyro full scale",
            fmt::format("{:.4g} rad/s", preset->full_scale.gyro_radps));
  facts.Add("accel full scale",
            fmt::format("{:.4g} m/s^2", preset->full_scale.accel_mps2));
  facts.Add("source of full scale", std::string(preset->range_source));
  facts.Add("grade", std::string(ImuGradeName(preset->grade)));
  context.Print(facts);
  return kDone;
}

}  // namespace

void AddImuPresets(CLI::App* rig, Context* context) {
  CLI::App* presets = rig->add_subcommand(
      "presets",
      "List the IMUs that --imu-preset and --imu1-preset of rig create know");
  const auto name = std::make_shared<std::string>();
  presets->add_option(
      "PRESET", *name, "Only this one, with the sources of its values");
  presets->callback([context, name] {
    context->command = [context, name] {
      return name->empty() ? ListPresets(*context)
                           : ShowPreset(*context, *name);
    };
  });
}

}  // namespace selfcal::client
