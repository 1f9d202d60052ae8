// A rendered recording as one that is read: images are rendered when they are
// asked for.
#pragma once

#include "client/recording/recording.h"
#include "test/rendering/rendered_recording.h"

namespace selfcal::client {

class RenderedSource : public Recording {
 public:
  // `rendered` must outlive the object.
  explicit RenderedSource(const RenderedRecording& rendered);

  absl::StatusOr<GreyPixels> ReadImage(int camera, int image) override;

 private:
  const RenderedRecording& rendered_;
};

}  // namespace selfcal::client
