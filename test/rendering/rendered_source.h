// A rendered recording as one that is read: images are rendered when they are
// asked for.
#pragma once

#include <set>

#include "client/recording/recording.h"
#include "test/rendering/rendered_recording.h"

namespace selfcal::client {

class RenderedSource : public Recording {
 public:
  // Images of the numbers `unreadable` are damaged; stamps from `gap_from` to
  // before `gap_to` are left out.
  struct Faults {
    std::set<int> unreadable = {};
    int gap_from = 0;
    int gap_to = 0;
  };

  // `rendered` must outlive the object.
  explicit RenderedSource(const RenderedRecording& rendered);
  RenderedSource(const RenderedRecording& rendered, const Faults& faults);

  absl::StatusOr<GreyPixels> ReadImage(int camera, int image) override;

 private:
  const RenderedRecording& rendered_;
  const Faults faults_;
};

}  // namespace selfcal::client
