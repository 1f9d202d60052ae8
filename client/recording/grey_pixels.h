// An image as every reader of recordings returns it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace selfcal::client {

struct GreyPixels {
  int width_px = 0;
  int height_px = 0;
  std::vector<std::uint8_t> pixels;  // row by row
};

// Limits of an image: a damaged header must not claim memory.
inline constexpr int kMaxImageSide_px = 16384;
inline constexpr std::size_t kMaxImagePixels = std::size_t{1} << 26;

}  // namespace selfcal::client
