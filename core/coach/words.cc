#include "core/coach/words.h"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "core/model/parameter_blocks.h"

namespace selfcal {
namespace {

constexpr std::size_t kMaxParts = 3;

// `rest` is the name of a component without its sensor; empty if no block has
// it.
template <class Blocks>
std::string Words(const Blocks& blocks, std::string_view rest) {
  for (const auto& block : blocks) {
    const BlockInfo& info = block.info;
    if (rest == info.name) return std::string(info.words);
    if (!rest.starts_with(info.name) || rest[info.name.size()] != '.') continue;
    return fmt::format("{}{}", info.words, rest.substr(info.name.size() + 1));
  }
  return "";
}

}  // namespace

std::string ComponentInWords(std::string_view component) {
  const std::size_t dot = std::min(component.find('.'), component.size());
  const std::string_view sensor = component.substr(0, dot);
  const std::string_view rest =
      component.substr(std::min(dot + 1, component.size()));
  std::string words;
  if (sensor == "imu") {
    words = Words(kImuBlocks, rest) + Words(kImuSlopes, rest);
  } else if (sensor == "imu1") {
    words = Words(kImuBlocks, rest) + Words(kMountBlocks, rest) +
            Words(kImuSlopes, rest);
    if (!words.empty()) words += " of the second IMU";
  } else if (sensor.starts_with("cam")) {
    words = Words(kCameraBlocks, rest) + Words(kCameraSlopes, rest);
    if (!words.empty()) {
      words += fmt::format(" of camera {}", sensor.substr(3));
    }
  }
  return words.empty() ? std::string(component) : words;
}

std::string DirectionInWords(const UnobservedDirection& direction) {
  const std::size_t count = std::min(kMaxParts, direction.parts.size());
  std::vector<std::string> parts;
  for (std::size_t i = 0; i < count; ++i) {
    parts.push_back(ComponentInWords(direction.parts[i].component));
  }
  if (count == 1) return parts.front();
  const bool more = count < direction.parts.size();
  return fmt::format("a combination of {}{}{}",
                     fmt::join(parts.begin(), parts.end() - 1, ", "),
                     more ? ", " : " and ",
                     more ? parts.back() + " and others" : parts.back());
}

}  // namespace selfcal
