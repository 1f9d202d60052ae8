#include "core/model/rig.h"

#include <algorithm>
#include <iterator>
#include <string>
#include <string_view>
#include <variant>

#include "core/model/parameter_blocks.h"

namespace selfcal {
namespace {

constexpr std::string_view kTimeOffset = "time_offset";

// Matches the components of a block; `sensor` is "imu", or "*" for all cameras.
template <class Sensor>
std::string Pattern(const std::string& sensor, const Block<Sensor>& block) {
  const bool scalar = std::holds_alternative<double Sensor::*>(block.value);
  return sensor + "." + std::string(block.info.name) + (scalar ? "" : ".*");
}

bool Matches(std::string_view name, std::string_view pattern) {
  const bool open_begin = pattern.starts_with('*');
  if (open_begin) pattern.remove_prefix(1);
  const bool open_end = pattern.ends_with('*');
  if (open_end) pattern.remove_suffix(1);
  if (open_begin && open_end) return name.find(pattern) != name.npos;
  if (open_begin) return name.ends_with(pattern);
  if (open_end) return name.starts_with(pattern);
  return name == pattern;
}

std::vector<int> Without(const std::vector<int>& all,
                         const std::vector<int>& removed) {
  std::vector<int> rest;
  std::set_difference(all.begin(),
                      all.end(),
                      removed.begin(),
                      removed.end(),
                      std::back_inserter(rest));
  return rest;
}

std::vector<int> HeldComponents(
    const Rig& rig, const std::vector<TangentComponent>& components) {
  std::vector<std::string> patterns = rig.fixed;
  for (const auto& block : kImuBlocks) {
    if (!block.info.estimated) patterns.push_back(Pattern("imu", block));
  }
  for (const auto& block : kCameraBlocks) {
    const bool asked =
        rig.estimate_time_offset && block.info.name == kTimeOffset;
    if (!block.info.estimated && !asked) {
      patterns.push_back(Pattern("*", block));
    }
  }
  return MatchComponents(components, patterns);
}

}  // namespace

std::vector<ParameterGroup> DefaultGroups(bool estimate_time_offset) {
  std::vector<ParameterGroup> groups = {
      {"imu", {"imu.*"}}, {"camera", {}}, {"extrinsics", {}}};
  if (estimate_time_offset) groups.push_back({"time", {}});
  for (const auto& block : kCameraBlocks) {
    for (ParameterGroup& group : groups) {
      if (group.name == block.info.group) {
        group.patterns.push_back(Pattern("*", block));
      }
    }
  }
  return groups;
}

std::vector<int> MatchComponents(
    const std::vector<TangentComponent>& components,
    const std::vector<std::string>& patterns) {
  std::vector<int> matched;
  for (std::size_t i = 0; i < components.size(); ++i) {
    const auto matches = [&](const std::string& pattern) {
      return Matches(components[i].name, pattern);
    };
    if (std::any_of(patterns.begin(), patterns.end(), matches)) {
      matched.push_back(static_cast<int>(i));
    }
  }
  return matched;
}

std::vector<int> GroupComponents(const Rig& rig, const ParameterGroup& group) {
  const auto components = TangentComponents(rig.factory);
  return Without(MatchComponents(components, group.patterns),
                 HeldComponents(rig, components));
}

std::vector<int> FreeComponents(const Rig& rig) {
  return GroupComponents(rig, {"", {"*"}});
}

std::vector<char> EstimatedTimeOffsets(const Rig& rig) {
  const std::vector<int> free = FreeComponents(rig);
  std::vector<char> estimated;
  for (int j = 0; j < static_cast<int>(rig.factory.cameras.size()); ++j) {
    estimated.push_back(std::binary_search(
        free.begin(), free.end(), TimeOffsetComponent(rig.factory, j)));
  }
  return estimated;
}

Eigen::VectorXd PriorSigmas(const Rig& rig) {
  constexpr double kDefaultInReferenceSigmas = 10;
  const auto components = TangentComponents(rig.factory);
  Eigen::VectorXd sigmas = kDefaultInReferenceSigmas * ReferenceSigmas(rig);
  for (const ComponentSetting& setting : rig.prior_sigmas) {
    for (const int i : MatchComponents(components, {setting.pattern})) {
      sigmas[i] = setting.value;
    }
  }
  return sigmas;
}

Eigen::VectorXd ReferenceSigmas(const Rig& rig) {
  const auto components = TangentComponents(rig.factory);
  Eigen::VectorXd sigmas(components.size());
  for (std::size_t i = 0; i < components.size(); ++i) {
    sigmas[static_cast<Eigen::Index>(i)] = components[i].sigma_ref;
  }
  return sigmas;
}

}  // namespace selfcal
