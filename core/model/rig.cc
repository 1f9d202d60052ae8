#include "core/model/rig.h"

#include <algorithm>
#include <array>
#include <iterator>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <type_traits>
#include <variant>

#include "core/model/parameter_blocks.h"

namespace selfcal {
namespace {

template <class Blocks>
bool HasBlock(const Blocks& blocks, std::string_view name) {
  return std::ranges::any_of(
      blocks, [&](const auto& block) { return block.info.name == name; });
}

// Matches the components of a block; `sensor` is "imu", "cam0", or "*" for all
// cameras.
template <class Sensor>
std::string Pattern(const std::string& sensor, const Block<Sensor>& block) {
  const bool scalar =
      std::holds_alternative<double Sensor::*>(block.value) ||
      std::holds_alternative<std::optional<double> Sensor::*>(block.value) ||
      block.info.sizes == std::array{1, 0};
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
  std::vector<int> held = MatchComponents(components, rig.fixed);
  VisitBlocks(
      [&](const BlockPlace& place, const auto& value) {
        if (IsEstimated(rig.blocks, place.Name())) return;
        for (int i = 0; i < TangentDimension(value); ++i) {
          held.push_back(place.offset + i);
        }
      },
      rig.factory);
  std::sort(held.begin(), held.end());
  held.erase(std::unique(held.begin(), held.end()), held.end());
  return held;
}

// Whether a block is estimated unless a rig states otherwise.
bool IsDeclaredEstimated(std::string_view block) {
  const std::size_t dot = block.find('.');
  const std::string_view name = block.substr(dot + 1);
  bool estimated = false;
  const auto find_in = [&](const auto& blocks) {
    for (const auto& one : blocks) {
      if (one.info.name == name) estimated = one.info.estimated;
    }
  };
  if (block.starts_with("imu")) {
    find_in(kImuBlocks);
    find_in(kMountBlocks);
    find_in(kImuSlopes);
  } else {
    find_in(kCameraBlocks);
    find_in(kCameraSlopes);
  }
  return estimated;
}

// The setting of a block, or null.
const BlockSetting* LastSetting(const std::vector<BlockSetting>& settings,
                                const std::string& block) {
  const auto last = std::find_if(
      settings.rbegin(), settings.rend(), [&](const BlockSetting& setting) {
        return Matches(block, setting.pattern);
      });
  return last != settings.rend() ? &*last : nullptr;
}

}  // namespace

bool IsEstimated(const std::vector<BlockSetting>& settings,
                 const std::string& block) {
  const BlockSetting* last = LastSetting(settings, block);
  return last != nullptr ? last->estimated : IsDeclaredEstimated(block);
}

std::vector<ParameterGroup> DefaultGroups(
    const std::vector<BlockSetting>& blocks, int cameras) {
  Calibration theta;
  theta.cameras.resize(cameras);
  return DefaultGroups(blocks, theta);
}

std::vector<ParameterGroup> DefaultGroups(
    const std::vector<BlockSetting>& blocks, const Calibration& theta) {
  std::vector<ParameterGroup> groups = {
      {"imu", {}}, {"imu1", {}}, {"camera", {}}, {"extrinsics", {}}};
  std::set<std::string_view> estimated;  // blocks of cameras
  VisitBlocks(
      [&](const BlockPlace& place, const auto&) {
        if (!IsEstimated(blocks, place.Name())) return;
        if (place.camera == kFirstImu) {
          groups[0].patterns = {"imu.*"};
        } else if (place.camera == kSecondImu) {
          groups[1].patterns = {"imu1.*"};
        } else {
          estimated.insert(place.info.name);
        }
      },
      theta);
  const auto add = [&](const Block<CameraCalibration>& block) {
    if (!estimated.contains(block.info.name)) return;
    const auto has_name = [&](const ParameterGroup& group) {
      return group.name == block.info.group;
    };
    auto group = std::find_if(groups.begin(), groups.end(), has_name);
    if (group == groups.end()) {
      group = groups.insert(group, {std::string(block.info.group), {}});
    }
    // "*.time_offset" would be that of a second IMU as well.
    const bool is_of_imu =
        theta.imu1 && HasBlock(kMountBlocks, block.info.name);
    if (!is_of_imu) {
      group->patterns.push_back(Pattern("*", block));
      return;
    }
    for (std::size_t j = 0; j < theta.cameras.size(); ++j) {
      group->patterns.push_back(Pattern("cam" + std::to_string(j), block));
    }
  };
  for (const auto& block : kCameraBlocks) add(block);
  for (const auto& block : kCameraSlopes) add(block);
  std::erase_if(groups, [](const ParameterGroup& group) {
    return group.patterns.empty();
  });
  return groups;
}

void AddEstimatedBlocks(const std::vector<BlockSetting>& blocks,
                        Calibration* theta) {
  const auto add_to = [&]<class Sensor>(const std::string& name,
                                        Sensor* sensor) {
    const auto add = [&]<class Value>(const BlockInfo& info, Value& value) {
      if (TangentDimension(value) > 0) return;
      const BlockSetting* setting =
          LastSetting(blocks, name + "." + std::string(info.name));
      if (setting == nullptr || !setting->estimated) return;
      if constexpr (std::is_same_v<Value, std::optional<double>>) {
        value = 0;
      } else if constexpr (std::is_same_v<Value, OptionalVector>) {
        value.setZero(OptionalSizes(info, *sensor)[0]);
      }
    };
    VisitWithSlopes(add, *sensor);
  };
  add_to("imu", &theta->imu);
  if (theta->imu1) add_to("imu1", &*theta->imu1);
  for (std::size_t j = 0; j < theta->cameras.size(); ++j) {
    add_to("cam" + std::to_string(j), &theta->cameras[j]);
  }
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
  const std::vector<TangentComponent> components =
      TangentComponents(rig.factory);
  const std::vector<int> free = FreeComponents(rig);
  std::vector<char> estimated;
  for (std::size_t j = 0; j < rig.factory.cameras.size(); ++j) {
    const std::string offset = "cam" + std::to_string(j) + ".time_offset";
    const std::string slope = offset + std::string(kSlopeSuffix);
    estimated.push_back(std::any_of(free.begin(), free.end(), [&](int i) {
      return components[i].name == offset || components[i].name == slope;
    }));
  }
  return estimated;
}

const Calibration& PriorMean(const Rig& rig) {
  return rig.prior_mean ? *rig.prior_mean : rig.factory;
}

Eigen::VectorXd PriorSigmas(const Rig& rig) {
  constexpr double kDefaultInReferenceSigmas = 10;
  const auto components = TangentComponents(rig.factory);
  Eigen::VectorXd sigmas = kDefaultInReferenceSigmas * ReferenceSigmas(rig);
  VisitBlocks(
      [&](const BlockPlace& place, const auto& value) {
        if (place.info.prior_sigma == 0) return;
        sigmas.segment(place.offset, TangentDimension(value)) *=
            place.info.prior_sigma /
            (kDefaultInReferenceSigmas * place.info.sigma_ref);
      },
      rig.factory);
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
