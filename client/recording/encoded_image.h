// Images as the files of their formats: PNG (libpng) and JPEG (libjpeg-turbo).
//
// Pure functions, callable from any thread. Errors are DATA_LOSS, with the
// library's reason, for bytes that are not a whole image or exceed the limits
// of grey_pixels.h.
#pragma once

#include <absl/status/statusor.h>

#include <string_view>

#include "client/recording/grey_pixels.h"

namespace selfcal::client {

// Decodes a PNG or a JPEG, recognised by its first bytes.
absl::StatusOr<GreyPixels> DecodeImage(std::string_view bytes);

}  // namespace selfcal::client
