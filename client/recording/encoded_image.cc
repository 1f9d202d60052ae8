#include "client/recording/encoded_image.h"

#include <absl/status/status.h>

#include "client/recording/jpeg_image.h"
#include "client/recording/png_image.h"

namespace selfcal::client {

absl::StatusOr<GreyPixels> DecodeImage(std::string_view bytes) {
  if (bytes.starts_with("\x89PNG")) return DecodePng(bytes);
  if (bytes.starts_with("\xff\xd8")) return DecodeJpeg(bytes);
  return absl::DataLossError("neither a PNG nor a JPEG");
}

}  // namespace selfcal::client
