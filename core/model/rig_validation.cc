// Validation of a rig.
#include <algorithm>
#include <cmath>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "core/model/parameter_blocks.h"
#include "core/model/rig.h"
#include "core/model/too_many.h"
#include "core/model/violation_list.h"

namespace selfcal {
namespace {

constexpr std::size_t kMaxNameLength = 63;
constexpr std::size_t kMaxGroups = 64;
constexpr int kMaxTableSize = 10'000;
constexpr int kMaxViolations = 1000;

// Describes the fault of a resource id; empty if there is none.
std::string NameFault(const std::string& name) {
  const bool in_alphabet = std::all_of(name.begin(), name.end(), [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '_' ||
           c == '-';
  });
  if (in_alphabet && !name.empty() && name.size() <= kMaxNameLength) return "";
  return "must be 1 to " + std::to_string(kMaxNameLength) +
         " characters of a-z, 0-9, '_' and '-'";
}

// Values that no device has, and with which the arithmetic breaks down, are
// typing errors or an attack. Wide: a hundred times beyond the best and the
// worst sensors.
struct PlausibleRange {
  double low;
  double high;
};

constexpr PlausibleRange kGyroNoise = {1e-7, 1};       // [rad/s/sqrt(Hz)]
constexpr PlausibleRange kAccelNoise = {1e-6, 10};     // [m/s^2/sqrt(Hz)]
constexpr PlausibleRange kGyroWalk = {1e-9, 1};        // [rad/s^2/sqrt(Hz)]
constexpr PlausibleRange kAccelWalk = {1e-8, 10};      // [m/s^3/sqrt(Hz)]
constexpr PlausibleRange kGyroFullScale = {0.1, 1e3};  // [rad/s]
constexpr PlausibleRange kAccelFullScale = {1, 1e4};   // [m/s^2]
constexpr PlausibleRange kPixelSigma = {1e-3, 1e3};
constexpr PlausibleRange kGravity = {0.1, 100};  // Ceres to Jupiter
// A prior sigma, in reference sigmas of its component.
constexpr PlausibleRange kPriorRatio = {1e-6, 1e6};
// Rounding of a value that is not estimated, in reference sigmas.
constexpr double kRounding = 1e-9;

void CheckRange(const std::string& field,
                double value,
                const PlausibleRange& range,
                ViolationList* list) {
  if (value >= range.low && value <= range.high) return;
  list->Add(field,
            Readable(value) + " is not between " + Readable(range.low) +
                " and " + Readable(range.high));
}

void CheckImuNoise(const std::string& field,
                   const ImuNoise& noise,
                   ViolationList* list) {
  CheckRange(field + ".gyro_noise_density",
             noise.gyro_noise_density,
             kGyroNoise,
             list);
  CheckRange(field + ".accel_noise_density",
             noise.accel_noise_density,
             kAccelNoise,
             list);
  CheckRange(field + ".gyro_bias_random_walk",
             noise.gyro_bias_random_walk,
             kGyroWalk,
             list);
  CheckRange(field + ".accel_bias_random_walk",
             noise.accel_bias_random_walk,
             kAccelWalk,
             list);
}

void CheckImuFullScale(const std::string& field,
                       const ImuFullScale& full_scale,
                       ViolationList* list) {
  CheckRange(field + ".gyro_max", full_scale.gyro_radps, kGyroFullScale, list);
  CheckRange(
      field + ".accel_max", full_scale.accel_mps2, kAccelFullScale, list);
}

// Adds a violation and returns false for a list that is too long to inspect.
bool CheckCount(const std::string& field,
                std::size_t count,
                std::size_t max_count,
                ViolationList* list) {
  if (count <= max_count) return true;
  list->Add(field, TooMany(count, max_count));
  return false;
}

// A pattern that matches nothing is treated as a spelling mistake.
void CheckPattern(const std::vector<TangentComponent>& components,
                  const std::string& field,
                  const std::string& pattern,
                  ViolationList* list) {
  if (!MatchComponents(components, {pattern}).empty()) return;
  list->Add(field,
            "'" + pattern + "' matches no component; use a name such as '" +
                components.front().name + "', or '*' at its begin or end");
}

void CheckPatterns(const std::vector<TangentComponent>& components,
                   const std::string& field,
                   const std::vector<std::string>& patterns,
                   ViolationList* list) {
  if (!CheckCount(field, patterns.size(), kMaxPatterns, list)) return;
  for (std::size_t i = 0; i < patterns.size(); ++i) {
    CheckPattern(components, ElementPath(field, i, ""), patterns[i], list);
  }
}

// Hint for a group of blocks that the rig does not estimate.
std::string BlocksHint(const Rig& rig, const ParameterGroup& group) {
  Rig estimating = rig;
  estimating.blocks = {{"*", true}};
  return GroupComponents(estimating, group).empty()
             ? ""
             : ", or switch its blocks on with blocks (or, for time offsets, "
               "estimate_time_offset)";
}

void CheckBlocks(const Rig& rig, ViolationList* list) {
  if (!CheckCount("blocks", rig.blocks.size(), kMaxPatterns, list)) return;
  std::vector<TangentComponent> names;
  for (const std::string& block : ComponentBlocks(rig.factory)) {
    names.push_back({block, "", 0});
  }
  for (std::size_t i = 0; i < rig.blocks.size(); ++i) {
    const std::string& pattern = rig.blocks[i].pattern;
    if (!MatchComponents(names, {pattern}).empty()) continue;
    list->Add(ElementPath("blocks", i, "pattern"),
              "'" + pattern + "' matches no block; use a name such as '" +
                  names.front().name + "', or '*' at its begin or end");
  }
}

void CheckGroups(const Rig& rig,
                 const std::vector<TangentComponent>& components,
                 ViolationList* list) {
  if (rig.groups.empty()) {
    list->Add("groups", "is empty; at least one group is needed");
  }
  if (!CheckCount("groups", rig.groups.size(), kMaxGroups, list)) return;
  std::set<std::string> names;
  for (std::size_t i = 0; i < rig.groups.size(); ++i) {
    const ParameterGroup& group = rig.groups[i];
    const std::string name_field = ElementPath("groups", i, "name");
    const std::string patterns_field = ElementPath("groups", i, "patterns");
    const std::string name_fault = NameFault(group.name);
    if (!name_fault.empty()) {
      list->Add(name_field, name_fault);
    } else if (!names.insert(group.name).second) {
      list->Add(name_field, "'" + group.name + "' names two groups");
    } else if (rig.selection != Selection::kTables &&
               group.name == kJointTable) {
      list->Add(name_field,
                "'" + group.name + "' names the table of a joint selection");
    }
    CheckPatterns(components, patterns_field, group.patterns, list);
    if (group.patterns.empty()) {
      list->Add(patterns_field, "is empty; the group matches no component");
    } else if (!MatchComponents(components, group.patterns).empty() &&
               GroupComponents(rig, group).empty()) {
      list->Add(patterns_field,
                "all components of the group are held fixed; drop the group" +
                    BlocksHint(rig, group));
    }
  }
}

void CheckPriorSigma(const std::vector<TangentComponent>& components,
                     const std::string& field,
                     const ComponentSetting& setting,
                     ViolationList* list) {
  for (const int k : MatchComponents(components, {setting.pattern})) {
    const TangentComponent& component = components[k];
    const double low = kPriorRatio.low * component.sigma_ref;
    const double high = kPriorRatio.high * component.sigma_ref;
    if (setting.value >= low && setting.value <= high) continue;
    list->Add(field,
              Readable(setting.value) + " is not between " + Readable(low) +
                  " and " + Readable(high) + " " + component.unit +
                  ", the plausible range for " + component.name);
    return;
  }
}

void CheckPriorSigmas(const Rig& rig,
                      const std::vector<TangentComponent>& components,
                      ViolationList* list) {
  if (!CheckCount(
          "prior_sigmas", rig.prior_sigmas.size(), kMaxPatterns, list)) {
    return;
  }
  for (std::size_t i = 0; i < rig.prior_sigmas.size(); ++i) {
    const ComponentSetting& setting = rig.prior_sigmas[i];
    CheckPattern(components,
                 ElementPath("prior_sigmas", i, "pattern"),
                 setting.pattern,
                 list);
    const std::string field = ElementPath("prior_sigmas", i, "value");
    if (!(std::isfinite(setting.value) && setting.value > 0)) {
      list->Add(field, Readable(setting.value) + " is not a positive number");
      continue;
    }
    CheckPriorSigma(components, field, setting, list);
  }
}

// `components` are those of the factory calibration.
void CheckPriorMean(const Rig& rig,
                    const std::vector<TangentComponent>& components,
                    ViolationList* list) {
  if (!rig.prior_mean) return;
  std::vector<Violation> faults = Validate(*rig.prior_mean, "prior_mean");
  for (Violation& fault : faults) {
    list->Add(std::move(fault.field), std::move(fault.message));
  }
  if (!faults.empty()) return;
  if (!SameShape(*rig.prior_mean, rig.factory) ||
      !SameImages(*rig.prior_mean, rig.factory)) {
    list->Add("prior_mean",
              "has other cameras, IMUs, parameter blocks or reference "
              "temperature than factory");
    return;
  }
  Eigen::VectorXd difference = BoxMinus(*rig.prior_mean, rig.factory);
  for (const int k : FreeComponents(rig)) difference(k) = 0;
  for (std::size_t k = 0; k < components.size(); ++k) {
    const double off = std::abs(difference(static_cast<Eigen::Index>(k)));
    if (off <= kRounding * components[k].sigma_ref) continue;
    list->Add("prior_mean",
              "differs from factory in " + components[k].name +
                  ", which the rig does not estimate; send the factory value");
    return;
  }
}

void CheckSelection(const Rig& rig, ViolationList* list) {
  if (rig.table_size < 1 || rig.table_size > kMaxTableSize) {
    list->Add("table_size",
              std::to_string(rig.table_size) + " is not in [1, " +
                  std::to_string(kMaxTableSize) + "]");
  }
  if (!(std::isfinite(rig.min_gain_nats) && rig.min_gain_nats >= 0)) {
    list->Add("min_gain_nats",
              Readable(rig.min_gain_nats) + " is not a number of at least 0");
  }
  if (!(rig.retrigger_fraction > 0 && rig.retrigger_fraction <= 1)) {
    list->Add("retrigger_fraction",
              Readable(rig.retrigger_fraction) + " is not in (0, 1]");
  }
}

}  // namespace

std::vector<Violation> Validate(const Rig& rig) {
  ViolationList list(kMaxViolations);
  const std::string id_fault = NameFault(rig.id);
  if (!id_fault.empty()) list.Add("id", id_fault);
  for (Violation& violation : Validate(rig.factory, "factory")) {
    list.Add(std::move(violation.field), std::move(violation.message));
  }
  CheckImuNoise("imu_noise", rig.imu_noise, &list);
  CheckImuFullScale("imu", rig.imu_full_scale, &list);
  if (rig.factory.imu1) {
    CheckImuNoise("imu1_noise", rig.imu1_noise, &list);
    CheckImuFullScale("imu1", rig.imu1_full_scale, &list);
  }
  CheckRange("pixel_sigma_px", rig.pixel_sigma_px, kPixelSigma, &list);
  CheckRange("gravity_mps2", rig.gravity_mps2, kGravity, &list);
  // Patterns have no components to match unless the number of cameras is valid.
  const std::size_t cameras = rig.factory.cameras.size();
  if (cameras >= 1 && cameras <= static_cast<std::size_t>(kMaxCameras)) {
    const auto components = TangentComponents(rig.factory);
    CheckGroups(rig, components, &list);
    CheckPriorSigmas(rig, components, &list);
    CheckPriorMean(rig, components, &list);
    CheckPatterns(components, "fixed", rig.fixed, &list);
    CheckBlocks(rig, &list);
    if (FreeComponents(rig).empty()) {
      list.Add("fixed", "holds every component; nothing would be estimated");
    }
  }
  CheckSelection(rig, &list);
  return list.Take();
}

}  // namespace selfcal
