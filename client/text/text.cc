#include "client/text/text.h"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <ctime>

namespace selfcal::client {
namespace {

// If a part of a unit vector is this large, no other is shown.
constexpr double kAlone = 0.98;
constexpr double kMinShownPart = 0.1;
constexpr int kMaxParts = 4;

// Converts "NOT_FULL" to "not full"; a name that ends with UNSPECIFIED becomes
// "unknown".
std::string Words(std::string name) {
  constexpr std::string_view kUnspecified = "UNSPECIFIED";
  if (name.size() >= kUnspecified.size() &&
      std::string_view(name).substr(name.size() - kUnspecified.size()) ==
          kUnspecified) {
    return "unknown";
  }
  for (char& c : name) {
    if (c == '_') c = ' ';
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  }
  return name.empty() ? "unknown" : name;
}

}  // namespace

std::string TimeText(const google::protobuf::Timestamp& time) {
  constexpr std::int64_t kYear9999 = 253402300799;
  if (time.seconds() <= 0 || time.seconds() > kYear9999) return "-";
  return fmt::format("{:%Y-%m-%d %H:%M:%S}",
                     fmt::gmtime(static_cast<std::time_t>(time.seconds())));
}

std::string CountText(std::int64_t count,
                      std::string_view noun,
                      std::string_view plural) {
  if (count == 1) return fmt::format("1 {}", noun);
  return plural.empty() ? fmt::format("{} {}s", count, noun)
                        : fmt::format("{} {}", count, plural);
}

std::string BytesText(std::int64_t bytes) {
  if (bytes < 1000) return fmt::format("{} B", bytes);
  if (bytes < 1'000'000) {
    return fmt::format("{:.1f} kB", static_cast<double>(bytes) / 1e3);
  }
  return fmt::format("{:.1f} MB", static_cast<double>(bytes) / 1e6);
}

std::string ValueText(double value, double sigma) {
  const bool usable = std::isfinite(sigma) && sigma > 0 && sigma < 1e6;
  if (!usable || !std::isfinite(value)) return fmt::format("{:.6g}", value);
  const int decimals =
      std::clamp(1 - static_cast<int>(std::floor(std::log10(sigma))), 0, 9);
  return fmt::format("{:.{}f}", value, decimals);
}

std::string SigmaText(double sigma) {
  return sigma > 0 ? fmt::format("{:.2g}", sigma) : "-";
}

std::string LastPart(std::string_view name) {
  const auto slash = name.rfind('/');
  return std::string(slash == name.npos ? name : name.substr(slash + 1));
}

std::string RigPart(std::string_view name) {
  constexpr std::string_view kRigs = "rigs/";
  if (!name.starts_with(kRigs)) return "";
  name.remove_prefix(kRigs.size());
  return std::string(name.substr(0, name.find('/')));
}

std::string StateText(v1::Calibration::State state) {
  return Words(v1::Calibration::State_Name(state));
}

std::string StateText(v1::Segment::State state) {
  return Words(v1::Segment::State_Name(state));
}

std::string StateText(v1::Recalibration::State state) {
  return Words(v1::Recalibration::State_Name(state));
}

std::string TriggerText(v1::Recalibration::Trigger trigger) {
  return Words(v1::Recalibration::Trigger_Name(trigger));
}

std::string KindText(v1::Event::Kind kind) {
  return Words(v1::Event::Kind_Name(kind));
}

std::string DirectionText(const v1::UnobservedDirection& direction) {
  std::string text;
  int parts = 0;
  for (const auto& part : direction.parts()) {
    const double weight = part.weight();
    if (parts == 0 && std::abs(weight) >= kAlone) {
      text = part.component();
      break;
    }
    if (parts > 0 && (std::abs(weight) < kMinShownPart || parts == kMaxParts)) {
      break;
    }
    if (parts == 0) {
      text += weight < 0 ? "-" : "";
    } else {
      text += weight < 0 ? " - " : " + ";
    }
    text += fmt::format("{:.2f} {}", std::abs(weight), part.component());
    ++parts;
  }
  return fmt::format("{} (information of the data: {:.2g} of the prior's)",
                     text.empty() ? "unnamed" : text,
                     direction.information_ratio());
}

}  // namespace selfcal::client
