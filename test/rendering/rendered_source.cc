#include "test/rendering/rendered_source.h"

#include <absl/status/status.h>
#include <fmt/format.h>

#include <utility>

namespace selfcal::client {
namespace {

RecordedData DataOf(const RenderedRecording& rendered,
                    const RenderedSource::Faults& faults) {
  RecordedData data;
  for (int j = 0; j < rendered.cameras(); ++j) {
    RecordedCamera camera;
    camera.name = fmt::format("cam{}", j);
    for (int i = 0; i < rendered.images(); ++i) {
      if (faults.gap_from <= i && i < faults.gap_to) continue;
      camera.image_times_ns.push_back(rendered.stamp_ns(i));
    }
    data.cameras.push_back(std::move(camera));
  }
  data.imu = rendered.imu().measured;
  return data;
}

}  // namespace

RenderedSource::RenderedSource(const RenderedRecording& rendered)
    : RenderedSource(rendered, Faults{}) {}

RenderedSource::RenderedSource(const RenderedRecording& rendered,
                               const Faults& faults)
    : Recording(DataOf(rendered, faults)),
      rendered_(rendered),
      faults_(faults) {}

absl::StatusOr<GreyPixels> RenderedSource::ReadImage(int camera, int image) {
  const int number = image < faults_.gap_from
                         ? image
                         : image + faults_.gap_to - faults_.gap_from;
  if (faults_.unreadable.contains(number)) {
    return absl::DataLossError(fmt::format("image {} is damaged", number));
  }
  GreyImage grey = rendered_.Image(camera, number);
  return GreyPixels{grey.width_px, grey.height_px, std::move(grey.pixels)};
}

}  // namespace selfcal::client
