#include "core/coach/words.h"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

namespace selfcal {
namespace {

constexpr std::size_t kMaxParts = 3;

struct Phrase {
  std::string_view block;  // of a name without the sensor and the last part
  std::string_view words;
};

constexpr Phrase kImuPhrases[] = {
    {"gyro.scale.", "the gyroscope's scale on "},
    {"gyro.misalignment.", "the gyroscope's misalignment "},
    {"accel.scale.", "the accelerometer's scale on "},
    {"accel.misalignment.", "the accelerometer's misalignment "},
    {"q_AI.", "the turn of the accelerometer against the gyroscope about "},
};
constexpr Phrase kCameraPhrases[] = {
    {"q_CI.", "the turn against the IMU about "},
    {"p_CI.", "the distance from the IMU along "},
    {"focal.", "the focal length in "},
    {"principal.", "the principal point in "},
    {"distortion.", "the distortion "},
    {"time_offset", "the delay of the images"},
};

template <std::size_t N>
std::string Words(const Phrase (&phrases)[N], std::string_view rest) {
  for (const Phrase& phrase : phrases) {
    if (!rest.starts_with(phrase.block)) continue;
    rest.remove_prefix(phrase.block.size());
    return fmt::format("{}{}", phrase.words, rest);
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
    words = Words(kImuPhrases, rest);
  } else if (sensor.starts_with("cam")) {
    words = Words(kCameraPhrases, rest);
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
  return fmt::format("a mix of {}{}{}",
                     fmt::join(parts.begin(), parts.end() - 1, ", "),
                     more ? ", " : " and ",
                     more ? parts.back() + " and others" : parts.back());
}

}  // namespace selfcal
