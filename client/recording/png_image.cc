#include "client/recording/png_image.h"

#include <absl/status/status.h>
#include <fmt/format.h>
#include <png.h>

#include <cstring>
#include <stdexcept>
#include <vector>

namespace selfcal::client {
namespace {

// libpng is C: its errors may pass its frames as exceptions only because they
// are compiled with unwind tables, as Debian's are on all of its machines.
[[noreturn]] void ThrowError(png_structp /*png*/, png_const_charp message) {
  throw std::runtime_error(message);
}

void IgnoreWarning(png_structp /*png*/, png_const_charp /*message*/) {}

void ReadBytes(png_structp png, png_bytep target, std::size_t size) {
  auto& rest = *static_cast<std::string_view*>(png_get_io_ptr(png));
  if (rest.size() < size) throw std::runtime_error("Read Error");
  std::memcpy(target, rest.data(), size);
  rest.remove_prefix(size);
}

// Chunks, each with its NUL, by which libpng would weight colours in linear
// light instead: a recording has the same pixels in any container.
constexpr png_byte kColourChunks[] = "gAMA\0sRGB\0cHRM\0iCCP";
constexpr int kColourChunkCount = 4;

class PngDecoder {
 public:
  explicit PngDecoder(std::string_view bytes) : rest_(bytes) {
    png_ = png_create_read_struct(
        PNG_LIBPNG_VER_STRING, nullptr, ThrowError, IgnoreWarning);
    if (png_ != nullptr) info_ = png_create_info_struct(png_);
    if (info_ == nullptr) throw std::runtime_error("no memory");
    png_set_user_limits(png_, kMaxImageSide_px, kMaxImageSide_px);
    png_set_keep_unknown_chunks(
        png_, PNG_HANDLE_CHUNK_NEVER, kColourChunks, kColourChunkCount);
    png_set_read_fn(png_, &rest_, ReadBytes);
  }
  ~PngDecoder() { png_destroy_read_struct(&png_, &info_, nullptr); }
  PngDecoder(const PngDecoder&) = delete;
  PngDecoder& operator=(const PngDecoder&) = delete;

  GreyPixels Decode() {
    png_read_info(png_, info_);
    const int colour = png_get_color_type(png_, info_);
    png_set_expand(png_);
    png_set_scale_16(png_);
    if ((colour & PNG_COLOR_MASK_COLOR) != 0) {
      png_set_rgb_to_gray_fixed(
          png_, PNG_ERROR_ACTION_NONE, PNG_RGB_TO_GRAY_DEFAULT, 0);
    }
    png_set_strip_alpha(png_);
    png_set_interlace_handling(png_);
    png_read_update_info(png_, info_);
    GreyPixels image;
    image.width_px = static_cast<int>(png_get_image_width(png_, info_));
    image.height_px = static_cast<int>(png_get_image_height(png_, info_));
    const auto width = static_cast<std::size_t>(image.width_px);
    const auto height = static_cast<std::size_t>(image.height_px);
    if (width * height > kMaxImagePixels) {
      throw std::runtime_error("too many pixels");
    }
    if (png_get_rowbytes(png_, info_) != width) {
      throw std::runtime_error("pixels that are not grey");
    }
    image.pixels.resize(width * height);
    std::vector<png_bytep> rows;
    for (std::size_t v = 0; v < height; ++v) {
      rows.push_back(image.pixels.data() + v * width);
    }
    png_read_image(png_, rows.data());
    png_read_end(png_, nullptr);
    return image;
  }

 private:
  std::string_view rest_;
  png_structp png_ = nullptr;
  png_infop info_ = nullptr;
};

}  // namespace

absl::StatusOr<GreyPixels> DecodePng(std::string_view bytes) {
  try {
    return PngDecoder(bytes).Decode();
  } catch (const std::exception& e) {
    return absl::DataLossError(fmt::format("not a whole PNG: {}", e.what()));
  }
}

}  // namespace selfcal::client
