#include "client/odometry/first_tracks.h"

#include <cstdint>
#include <utility>

#include "client/tracking/feature_tracker.h"

namespace selfcal::client {
namespace {

constexpr double kSeconds = 20;

}  // namespace

std::vector<TrackedImage> FirstTracks(Recording* recording,
                                      const CameraCalibration& theta,
                                      int camera) {
  Calibration alone;
  alone.cameras = {theta};
  FeatureTracker tracker(alone, {});
  std::vector<TrackedImage> images;
  const std::vector<std::int64_t>& times_ns =
      recording->cameras()[camera].image_times_ns;
  for (std::size_t i = 0; i < times_ns.size(); ++i) {
    if (1e-9 * static_cast<double>(times_ns[i] - times_ns[0]) > kSeconds) break;
    if (const auto* points = recording->Points(camera, static_cast<int>(i))) {
      TrackedImage& recorded = images.emplace_back();
      recorded.t_ns = times_ns[i];
      for (const RecordedPoint& point : *points) {
        recorded.points.push_back({point.landmark, point.z_px});
      }
      continue;
    }
    auto pixels = recording->ReadImage(camera, static_cast<int>(i));
    if (!pixels.ok()) continue;
    const cv::Mat image(
        pixels->height_px, pixels->width_px, CV_8UC1, pixels->pixels.data());
    TrackedImage tracked;
    tracked.t_ns = times_ns[i];
    for (const TrackPoint& point : tracker.Track(times_ns[i], {image})) {
      tracked.points.push_back({point.landmark, point.z_px});
    }
    images.push_back(std::move(tracked));
  }
  return images;
}

}  // namespace selfcal::client
