#include "test/rendering/rendered_source.h"

#include <fmt/format.h>

#include <utility>

namespace selfcal::client {
namespace {

RecordedData DataOf(const RenderedRecording& rendered) {
  RecordedData data;
  for (int j = 0; j < rendered.cameras(); ++j) {
    RecordedCamera camera;
    camera.name = fmt::format("cam{}", j);
    for (int i = 0; i < rendered.images(); ++i) {
      camera.image_times_ns.push_back(rendered.stamp_ns(i));
    }
    data.cameras.push_back(std::move(camera));
  }
  data.imu = rendered.imu().measured;
  if (rendered.imu1()) data.imu1 = rendered.imu1()->measured;
  return data;
}

}  // namespace

RenderedSource::RenderedSource(const RenderedRecording& rendered)
    : Recording(DataOf(rendered)), rendered_(rendered) {}

absl::StatusOr<GreyPixels> RenderedSource::ReadImage(int camera, int image) {
  GreyImage grey = rendered_.Image(camera, image);
  return GreyPixels{grey.width_px, grey.height_px, std::move(grey.pixels)};
}

}  // namespace selfcal::client
