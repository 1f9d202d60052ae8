// Decodes JPEG, by libjpeg-turbo.
//
// A pure function, callable from any thread.
#pragma once

#include <absl/status/statusor.h>

#include <string_view>

#include "client/recording/grey_pixels.h"

namespace selfcal::client {

// Decodes a JPEG as 8 bits of grey: of colours, their luma (ITU-R BT.601).
// DATA_LOSS with the library's reason for what is not a whole JPEG, and also
// for data of which it would guess a part.
absl::StatusOr<GreyPixels> DecodeJpeg(std::string_view bytes);

}  // namespace selfcal::client
