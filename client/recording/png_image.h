// Decodes PNG, by libpng.
//
// A pure function but for the file that it reads; callable from any thread.
#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <string>
#include <vector>

namespace selfcal::client {

struct GreyPixels {
  int width_px = 0;
  int height_px = 0;
  std::vector<std::uint8_t> pixels;  // row by row
};

// Limit on either side of an image: a damaged header must not claim memory.
inline constexpr int kMaxImageSide_px = 16384;

// Reads a PNG of grey, colours or a palette as 8 bits of grey: 16 bits are
// rounded, colours weighted as by ITU-R BT.709, transparency is ignored.
// NOT_FOUND for a file that cannot be opened, DATA_LOSS with libpng's reason
// for one that is not a whole PNG.
absl::StatusOr<GreyPixels> ReadPng(const std::string& path);

}  // namespace selfcal::client
