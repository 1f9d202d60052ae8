#include "client/recording/image_files.h"

#include <absl/status/status.h>
#include <fmt/format.h>

#include <utility>

#include "client/recording/encoded_image.h"
#include "client/recording/input_file.h"

namespace selfcal::client {

ImageFileRecording::ImageFileRecording(RecordedData data, ImagePaths paths)
    : Recording(std::move(data)), paths_(std::move(paths)) {}

absl::StatusOr<GreyPixels> ImageFileRecording::ReadImage(int camera,
                                                         int image) {
  const auto j = static_cast<std::size_t>(camera);
  const std::string& path = paths_[j][static_cast<std::size_t>(image)];
  auto bytes = ReadWholeFile(path, kMaxImageFileBytes);
  if (!bytes.ok()) return bytes.status();
  return Checked(DecodeImage(*bytes), path, camera);
}

}  // namespace selfcal::client
