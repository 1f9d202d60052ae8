#include "client/odometry/clock_shift.h"

#include <absl/status/status.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "client/odometry/first_tracks.h"
#include "core/initialisation/rotation_start.h"

namespace selfcal::client {
namespace {

constexpr double kRange_s = 10;
constexpr std::int64_t kMillisecond_ns = 1'000'000;

// Nothing of one is at the time of the other.
bool AreApart(const std::vector<std::int64_t>& images_ns,
              const std::vector<ImuSample>& readings) {
  return readings.back().t_ns < images_ns.front() ||
         images_ns.back() < readings.front().t_ns;
}

std::int64_t InMilliseconds(double ns) {
  return std::llround(ns / kMillisecond_ns) * kMillisecond_ns;
}

}  // namespace

absl::StatusOr<std::int64_t> FindClockShift(Recording* recording,
                                            const Calibration& theta,
                                            const UnknownOfCamera& unknown) {
  const RecordedCamera& recorded = recording->cameras().front();
  const CameraCalibration& camera = theta.cameras.front();
  std::vector<TrackedImage> images = FirstTracks(recording, camera, 0);
  const auto find = [&](double range_s) {
    return FindRotationStart(camera,
                             theta.imu,
                             images,
                             recording->imu(),
                             {.search_rotation = unknown.rotation,
                              .max_time_offset_s = range_s,
                              .estimate_focal_scale = unknown.focal});
  };
  const bool apart = AreApart(recorded.image_times_ns, recording->imu());
  std::int64_t to_images_ns = 0;
  if (apart) {
    to_images_ns = InMilliseconds(static_cast<double>(
        recorded.image_times_ns.front() - recording->imu().front().t_ns));
    for (TrackedImage& image : images) image.t_ns -= to_images_ns;
  } else if (find(RotationSearch().max_time_offset_s).start) {
    return 0;
  }
  const RotationStartResult found = find(kRange_s);
  if (found.start) {
    return to_images_ns - InMilliseconds(1e9 * (found.start->time_offset_s -
                                                camera.time_offset_s));
  }
  if (!apart) return 0;
  return absl::NotFoundError(
      fmt::format("images and readings have no time in common (their stamps "
                  "begin {:.3f} s apart), and how their clocks differ is not "
                  "to be seen: {}",
                  1e-9 * static_cast<double>(std::abs(to_images_ns)),
                  found.reason));
}

}  // namespace selfcal::client
