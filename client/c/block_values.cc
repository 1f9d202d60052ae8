#include "client/c/block_values.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <type_traits>

#include "core/model/parameter_blocks.h"

namespace selfcal::c {
namespace {

// Sets the value; returns whether it has this number of components.
template <class Sensor, class Value>
bool Set(const BlockInfo& info,
         const Sensor& sensor,
         std::span<const double> from,
         Value* value) {
  if constexpr (std::is_same_v<Value, Eigen::Quaterniond>) {
    if (from.size() != 4) return false;
    *value = Eigen::Quaterniond(from[0], from[1], from[2], from[3]);
  } else if constexpr (std::is_same_v<Value, double>) {
    if (from.size() != 1) return false;
    *value = from[0];
  } else if constexpr (std::is_same_v<Value, std::optional<double>>) {
    if (from.size() > 1) return false;
    value->reset();
    if (!from.empty()) *value = from[0];
  } else {
    const auto size = static_cast<int>(from.size());
    bool fits = size == value->size();
    if constexpr (std::is_same_v<Value, OptionalVector>) {
      fits = size == 0 ||
             std::ranges::count(OptionalSizes(info, sensor), size) > 0;
    }
    if (!fits) return false;
    *value = Eigen::Map<const Eigen::VectorXd>(from.data(), size);
  }
  return true;
}

}  // namespace

absl::Status SetBlock(const std::string& name,
                      std::span<const double> values,
                      Calibration* theta) {
  bool known = false;
  bool fits = false;
  const auto set_of = [&](const std::string& of, auto* sensor) {
    const auto set = [&](const BlockInfo& info, auto& value) {
      if (known || name != fmt::format("{}.{}", of, info.name)) return;
      known = true;
      fits = Set(info, *sensor, values, &value);
    };
    VisitWithSlopes(set, *sensor);
  };
  set_of("imu", &theta->imu);
  if (theta->imu1) set_of("imu1", &*theta->imu1);
  for (std::size_t j = 0; j < theta->cameras.size(); ++j) {
    set_of(fmt::format("cam{}", j), &theta->cameras[j]);
  }
  if (!known) {
    return absl::InvalidArgumentError(
        fmt::format("name: there is no block '{}'", name));
  }
  if (fits) return absl::OkStatus();
  return absl::InvalidArgumentError(fmt::format(
      "size: {} is not a number of values of {}", values.size(), name));
}

}  // namespace selfcal::c
