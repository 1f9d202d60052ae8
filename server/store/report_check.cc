#include "server/store/report_check.h"

#include <fmt/format.h>

#include <Eigen/Core>
#include <string>
#include <vector>

#include "server/status/status_macros.h"

namespace selfcal::server {
namespace {

absl::Status Bad(const std::string& what) {
  return absl::InvalidArgumentError(what);
}

absl::Status CheckTheta(const Calibration& theta, const Calibration& factory) {
  if (!SameShape(theta, factory) || !SameImages(theta, factory)) {
    return Bad("a calibration has other sensors or parameters than its rig");
  }
  if (!ReadableValues(theta).allFinite()) {
    return Bad("a calibration has values that are no numbers");
  }
  return absl::OkStatus();
}

// `size`: of the tangent.
absl::Status CheckMatrix(const Eigen::MatrixXd& matrix,
                         int size,
                         const char* name) {
  if (matrix.rows() != size || matrix.cols() != size) {
    return Bad(fmt::format("its {} is {} x {}, not {} x {}",
                           name,
                           matrix.rows(),
                           matrix.cols(),
                           size,
                           size));
  }
  if (!matrix.allFinite()) {
    return Bad(fmt::format("its {} has values that are no numbers", name));
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status CheckReported(const StoredCalibration& calibration,
                           const Calibration& factory) {
  const int size = TangentSize(factory);
  SELFCAL_RETURN_IF_ERROR(CheckTheta(calibration.theta, factory));
  SELFCAL_RETURN_IF_ERROR(
      CheckMatrix(calibration.covariance, size, "covariance"));
  if (calibration.report) {
    const Eigen::VectorXd& change =
        calibration.report->remembered.change_sigmas;
    if (change.size() != 0 && change.size() != size) {
      return Bad("its change by remembered segments has another size");
    }
    const Eigen::MatrixXd& of_data = calibration.report->covariance_of_data;
    if (of_data.size() != 0) {
      SELFCAL_RETURN_IF_ERROR(
          CheckMatrix(of_data, size, "covariance of the data"));
    }
  }
  for (const CalibrateProgress& step : calibration.steps) {
    // Older ones have no values.
    if (step.sigmas.size() == 0) continue;
    SELFCAL_RETURN_IF_ERROR(CheckTheta(step.theta, factory));
  }
  return absl::OkStatus();
}

absl::Status CheckReported(const SegmentInformation& information,
                           const Calibration& factory) {
  const int size = TangentSize(factory);
  SELFCAL_RETURN_IF_ERROR(CheckTheta(information.theta0, factory));
  SELFCAL_RETURN_IF_ERROR(CheckMatrix(information.Lambda, size, "information"));
  if (information.eta.size() != size || !information.eta.allFinite()) {
    return Bad("its information vector has another size, or no numbers");
  }
  return absl::OkStatus();
}

absl::Status CheckReported(const MotionSegment& segment,
                           const std::string& what,
                           const Calibration& factory) {
  const std::vector<Violation> violations = Validate(segment, factory);
  if (violations.empty()) return absl::OkStatus();
  return absl::DataLossError(
      fmt::format("the data of {} is not that of a segment: {} {}",
                  what,
                  violations.front().field,
                  violations.front().message));
}

absl::Status CheckReportedTime(std::int64_t time_ns) {
  if (time_ns >= 0) return absl::OkStatus();
  return Bad("a time is before 1970");
}

}  // namespace selfcal::server
