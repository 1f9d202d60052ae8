#include "client/odometry/start.h"

#include <fmt/format.h>

#include <utility>
#include <vector>

#include "client/odometry/odometry.h"
#include "core/calibration/calibrate.h"
#include "core/calibration/theta_prior.h"

namespace selfcal::client {
namespace {

constexpr int kSegments = 10;

}  // namespace

absl::StatusOr<CalibrationStart> FindStart(Recording* recording,
                                           const Rig& rig) {
  Odometry odometry(recording, rig, rig.factory, {.session = "start"});
  std::vector<MotionSegment> segments;
  std::string failure = "the recording is too short";
  for (int i = 0; i < kSegments; ++i) {
    auto next = odometry.Next(rig.factory, 1);
    if (!next.ok()) return next.status();
    if (!*next) break;
    if ((*next)->failure.empty()) {
      segments.push_back(std::move((*next)->segment));
    } else {
      failure = (*next)->failure;
    }
  }
  if (segments.empty()) return absl::NotFoundError(failure);
  CalibrateOptions options;
  options.prior = FactoryPrior(rig);
  const CalibrationResult result =
      Calibrate(rig, rig.factory, segments, options);
  if (result.status != CalibrateStatus::kConverged) {
    return absl::NotFoundError(
        fmt::format("a calibration on {} segments does not converge{}{}",
                    segments.size(),
                    result.message.empty() ? "" : ": ",
                    result.message));
  }
  return CalibrationStart{result.theta, result.segments};
}

}  // namespace selfcal::client
