// Recordings whose images are files.
#pragma once

#include <absl/status/statusor.h>

#include <string>
#include <vector>

#include "client/recording/recording.h"

namespace selfcal::client {

// Path of each image, by camera.
using ImagePaths = std::vector<std::vector<std::string>>;

class ImageFileRecording : public Recording {
 public:
  // `paths` are those of the image times in `data`.
  ImageFileRecording(RecordedData data, ImagePaths paths);

  absl::StatusOr<GreyPixels> ReadImage(int camera, int image) override;

 private:
  const ImagePaths paths_;
};

}  // namespace selfcal::client
