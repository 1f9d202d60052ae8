#include "client/odometry/start.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "client/odometry/first_tracks.h"
#include "client/odometry/odometry.h"
#include "core/calibration/calibrate.h"
#include "core/calibration/theta_prior.h"
#include "core/initialisation/rotation_start.h"

namespace selfcal::client {
namespace {

constexpr int kSegments = 10;
// An offset that differs by less from the given one is found later, and better.
constexpr double kLeastOffset_s = 5e-3;
constexpr double kOffsetSigmas = 3;

// Moves a camera to where its rotations agree with those of the gyroscope.
absl::Status Turn(Recording* recording,
                  const UnknownOfCamera& unknown,
                  bool offset_is_estimated,
                  int camera,
                  Calibration* theta) {
  CameraCalibration& moved = theta->cameras[camera];
  const std::vector<TrackedImage> images =
      FirstTracks(recording, moved, camera);
  const RotationStartResult found =
      FindRotationStart(moved,
                        theta->imu,
                        images,
                        recording->imu(),
                        {.search_rotation = unknown.rotation,
                         .estimate_focal_scale = unknown.focal});
  if (!found.start) {
    if (!unknown.rotation && !unknown.focal) return absl::OkStatus();
    return absl::NotFoundError(
        fmt::format("{}: {}", recording->cameras()[camera].name, found.reason));
  }
  const RotationStart& start = *found.start;
  if (unknown.rotation) moved.q_CI = start.q_CI;
  if (unknown.focal) moved.f *= start.focal_scale;
  const double change_s = std::abs(start.time_offset_s - moved.time_offset_s);
  if (offset_is_estimated &&
      change_s > std::max(kLeastOffset_s,
                          kOffsetSigmas * start.Sigma(kStartTimeOffset))) {
    moved.time_offset_s = start.time_offset_s;
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<CalibrationStart> FindStart(
    Recording* recording,
    const Rig& given,
    const std::vector<UnknownOfCamera>& unknown,
    std::optional<double> temperature_c) {
  Rig rig = given;
  const std::vector<char> offsets = EstimatedTimeOffsets(rig);
  for (std::size_t j = 0; j < unknown.size(); ++j) {
    const absl::Status turned = Turn(recording,
                                     unknown[j],
                                     offsets[j] != 0,
                                     static_cast<int>(j),
                                     &rig.factory);
    if (!turned.ok()) return turned;
  }
  Odometry odometry(recording,
                    rig,
                    rig.factory,
                    {.session = "start", .temperature_c = temperature_c});
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
