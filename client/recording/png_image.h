// Decodes PNG, by libpng.
//
// A pure function, callable from any thread.
#pragma once

#include <absl/status/statusor.h>

#include <string_view>

#include "client/recording/grey_pixels.h"

namespace selfcal::client {

// Decodes a PNG of grey, colours or a palette as 8 bits of grey: 16 bits are
// rounded, colours weighted as by ITU-R BT.709 whatever their gamma,
// transparency is ignored. DATA_LOSS with libpng's reason for what is not a
// whole PNG.
absl::StatusOr<GreyPixels> DecodePng(std::string_view bytes);

}  // namespace selfcal::client
