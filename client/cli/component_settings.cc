#include "client/cli/component_settings.h"

#include <absl/strings/numbers.h>
#include <fmt/format.h>

#include "core/model/calibration.h"
#include "core/model/rig.h"
#include "proto/convert.h"
#include "proto/nearest_word.h"

namespace selfcal::client {
namespace {

// The names up to the last dot, each once: imu.gyro.scale of imu.gyro.scale.x.
std::vector<std::string> BlocksOf(
    const std::vector<TangentComponent>& components) {
  std::vector<std::string> blocks;
  for (const TangentComponent& component : components) {
    std::string block = component.name.substr(0, component.name.rfind('.'));
    if (blocks.empty() || blocks.back() != block) {
      blocks.push_back(std::move(block));
    }
  }
  return blocks;
}

}  // namespace

std::optional<std::pair<std::string, std::string>> SplitPair(
    const std::string& text) {
  const auto equals = text.find('=');
  if (equals == text.npos || equals == 0) return std::nullopt;
  return std::pair(text.substr(0, equals), text.substr(equals + 1));
}

absl::Status NotAPair(const std::string& flag,
                      const std::string& text,
                      const std::string& form) {
  return absl::InvalidArgumentError(
      fmt::format("{}: '{}' is not of the form {}", flag, text, form));
}

absl::Status ReadSettings(
    const std::string& flag,
    const std::vector<std::string>& texts,
    google::protobuf::RepeatedPtrField<v1::ComponentSetting>* settings) {
  for (const std::string& text : texts) {
    const auto pair = SplitPair(text);
    double value = 0;
    if (!pair || !absl::SimpleAtod(pair->second, &value)) {
      return NotAPair(flag, text, "COMPONENT=NUMBER");
    }
    v1::ComponentSetting* added = settings->Add();
    added->set_pattern(pair->first);
    added->set_value(value);
  }
  return absl::OkStatus();
}

absl::Status NameComponents(
    const std::string& flag,
    const v1::Rig& rig,
    google::protobuf::RepeatedPtrField<v1::ComponentSetting>* settings) {
  Calibration factory;
  if (!FromProto(rig.factory(), "", &factory).empty()) {
    return absl::OkStatus();  // the daemon names what is wrong
  }
  const auto components = TangentComponents(factory);
  for (v1::ComponentSetting& setting : *settings) {
    const std::string& pattern = setting.pattern();
    if (!MatchComponents(components, {pattern}).empty()) continue;
    const std::string block = pattern + ".*";
    if (!MatchComponents(components, {block}).empty()) {
      setting.set_pattern(block);
      continue;
    }
    std::vector<std::string> names;
    for (const auto& component : components) names.push_back(component.name);
    return absl::InvalidArgumentError(fmt::format(
        "{}: the rig has no component '{}'{}\n  Known: {}; one component of "
        "each as {}, several with a '*' at either end",
        flag,
        pattern,
        DidYouMean(pattern, names),
        fmt::join(BlocksOf(components), ", "),
        names.front()));
  }
  return absl::OkStatus();
}

}  // namespace selfcal::client
