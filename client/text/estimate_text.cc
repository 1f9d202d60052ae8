#include "client/text/estimate_text.h"

#include <numbers>

namespace selfcal::client {
namespace {

constexpr double kDegrees = 180 / std::numbers::pi;
constexpr char kRotationUnit[] = "rad";
constexpr char kShownRotationUnit[] = "deg from factory";

}  // namespace

ShownEstimate Shown(const v1::ComponentEstimate& estimate) {
  if (estimate.unit() != kRotationUnit || !estimate.has_from_factory()) {
    return {estimate.value(), estimate.sigma(), estimate.unit()};
  }
  return {kDegrees * estimate.from_factory(),
          kDegrees * estimate.sigma(),
          kShownRotationUnit};
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
  return {kDegrees * difference.from_factory_a(),
          kDegrees * difference.from_factory_b(),
          kDegrees * difference.difference(),
          kDegrees * difference.sigma(),
          kShownRotationUnit};
}

std::string VerdictText(const v1::Calibration& calibration) {
  return calibration.has_verdict() ? calibration.verdict().text() : "unknown";
}

}  // namespace selfcal::client
