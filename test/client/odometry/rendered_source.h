// A rendered recording as one that is read: images are rendered when they are
// asked for.
#pragma once

#include <absl/status/status.h>
#include <fmt/format.h>

#include <set>
#include <utility>

#include "client/recording/recording.h"
#include "test/rendering/rendered_recording.h"

namespace selfcal::client {

class RenderedSource : public Recording {
 public:
  // Images of the numbers `missing` cannot be read, the stamps between
  // `gap_from` and `gap_to` are left out. `rendered` must outlive the object.
  struct Faults {
    std::set<int> unreadable = {};
    int gap_from = 0;
    int gap_to = 0;
  };

  explicit RenderedSource(const RenderedRecording& rendered)
      : RenderedSource(rendered, Faults{}) {}
  RenderedSource(const RenderedRecording& rendered, const Faults& faults)
      : Recording(DataOf(rendered, faults)),
        rendered_(rendered),
        faults_(faults) {}

  absl::StatusOr<GreyPixels> ReadImage(int camera, int image) override {
    const int number =
        image < faults_.gap_from
            ? image
            : image + faults_.gap_to - faults_.gap_from;
    if (faults_.unreadable.contains(number)) {
      return absl::DataLossError(fmt::format("image {} is damaged", number));
    }
    GreyImage grey = rendered_.Image(camera, number);
    return GreyPixels{grey.width_px, grey.height_px, std::move(grey.pixels)};
  }

 private:
  static RecordedData DataOf(const RenderedRecording& rendered,
                             const Faults& faults) {
    RecordedData data;
    for (int j = 0; j < rendered.cameras(); ++j) {
      RecordedCamera camera{.name = fmt::format("cam{}", j)};
      for (int i = 0; i < rendered.images(); ++i) {
        if (faults.gap_from <= i && i < faults.gap_to) continue;
        camera.image_times_ns.push_back(rendered.stamp_ns(i));
      }
      data.cameras.push_back(std::move(camera));
    }
    data.imu = rendered.imu().measured;
    return data;
  }

  const RenderedRecording& rendered_;
  const Faults faults_;
};

}  // namespace selfcal::client
