#include "client/selfcal/calibration_version.h"

#include <fmt/format.h>

#include <vector>

#include "core/model/temperature.h"
#include "proto/convert.h"

namespace selfcal::client {
namespace {

absl::Status Broken(const Violation& violation) {
  return absl::DataLossError(
      fmt::format("{}: {}", violation.field, violation.message));
}

CalibrationVersion::Verdict ToVerdict(v1::Verdict::Kind kind) {
  using Verdict = CalibrationVersion::Verdict;
  switch (kind) {
    case v1::Verdict::GOOD:
      return Verdict::kGood;
    case v1::Verdict::WEAK:
      return Verdict::kWeak;
    case v1::Verdict::NOT_TRUSTWORTHY:
      return Verdict::kNotTrustworthy;
    case v1::Verdict::FACTORY:
      return Verdict::kFactory;
    default:
      return Verdict::kUnknown;
  }
}

}  // namespace

CalibrationVersion AtTemperature(const CalibrationVersion& version,
                                 double temperature_c) {
  CalibrationVersion at = version;
  at.theta = selfcal::AtTemperature(version.theta, temperature_c);
  if (version.covariance.size() > 0) {
    at.covariance = CovarianceAtTemperature(
        version.theta, version.covariance, temperature_c);
  }
  return at;
}

absl::StatusOr<CalibrationVersion> ToCalibrationVersion(
    const v1::Calibration& message) {
  CalibrationVersion value;
  value.version = message.version();
  value.verdict = ToVerdict(message.verdict().kind());
  value.reasons.assign(message.verdict().sentences().begin(),
                       message.verdict().sentences().end());
  std::vector<Violation> violations =
      FromProto(message.parameters(), "parameters.", &value.theta);
  if (violations.empty()) violations = Validate(value.theta, "parameters");
  if (!violations.empty()) return Broken(violations.front());

  const int size = TangentSize(value.theta);
  const int entries = size * (size + 1) / 2;
  if (message.covariance_size() == 0) return value;
  if (message.covariance_size() != entries) {
    return Broken({"covariance",
                   fmt::format("has {} entries, must have {}",
                               message.covariance_size(),
                               entries)});
  }
  value.covariance.resize(size, size);
  int entry = 0;
  for (int row = 0; row < size; ++row) {
    for (int column = 0; column <= row; ++column) {
      const double covariance = message.covariance(entry++);
      value.covariance(row, column) = covariance;
      value.covariance(column, row) = covariance;
    }
  }
  return value;
}

}  // namespace selfcal::client
