#include "client/text/estimate_text.h"

#include <numbers>

namespace selfcal::client {
namespace {

constexpr double kDegrees = 180 / std::numbers::pi;
constexpr char kRotationUnit[] = "rad";
constexpr char kShownRotationUnit[] = "deg";
constexpr char kFromFactory[] = " from factory";

}  // namespace

double ShownValue(double value, const std::string& unit) {
  return unit == kRotationUnit ? kDegrees * value : value;
}

std::string ShownUnit(const std::string& unit) {
  return unit == kRotationUnit ? kShownRotationUnit : unit;
}

ShownEstimate Shown(const v1::ComponentEstimate& estimate) {
  if (estimate.unit() != kRotationUnit || !estimate.has_from_factory()) {
    return {estimate.value(), estimate.sigma(), estimate.unit()};
  }
  const std::string& unit = estimate.unit();
  return {ShownValue(estimate.from_factory(), unit),
          ShownValue(estimate.sigma(), unit),
          ShownUnit(unit) + kFromFactory};
}

ShownDifference Shown(
    const v1::CompareCalibrationsResponse::Difference& difference) {
  if (difference.unit() != kRotationUnit || !difference.has_from_factory_a() ||
      !difference.has_from_factory_b()) {
    return {difference.value_a(),
            difference.value_b(),
            difference.difference(),
            difference.sigma(),
            difference.unit()};
  }
  const std::string& unit = difference.unit();
  return {ShownValue(difference.from_factory_a(), unit),
          ShownValue(difference.from_factory_b(), unit),
          ShownValue(difference.difference(), unit),
          ShownValue(difference.sigma(), unit),
          ShownUnit(unit) + kFromFactory};
}

std::string VerdictText(const v1::Calibration& calibration) {
  return calibration.has_verdict() ? calibration.verdict().text() : "unknown";
}

}  // namespace selfcal::client
