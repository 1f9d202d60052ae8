#include "client/recording/jpeg_image.h"

#include <absl/status/status.h>
#include <fmt/format.h>
#include <jerror.h>
#include <jpeglib.h>  // needs the types of <cstdio>

#include <cstddef>
#include <cstdio>
#include <stdexcept>

namespace selfcal::client {
namespace {

// Limits beyond which a file of a few kB would take seconds or all memory.
constexpr int kMaxScans = 200;
constexpr long kMaxWorkingBytes = 256L << 20;

std::string MessageOf(j_common_ptr jpeg) {
  char text[JMSG_LENGTH_MAX];
  jpeg->err->format_message(jpeg, text);
  return text;
}

// Exceptions may pass the library's frames, as with libpng.
[[noreturn]] void ThrowError(j_common_ptr jpeg) {
  throw std::runtime_error(MessageOf(jpeg));
}

// Level -1 is a warning about data that are damaged. Webcams pad their images,
// which is harmless.
void ThrowWarning(j_common_ptr jpeg, int level) {
  if (level < 0 && jpeg->err->msg_code != JWRN_EXTRANEOUS_DATA) {
    ThrowError(jpeg);
  }
}

void LimitScans(j_common_ptr jpeg) {
  if (reinterpret_cast<j_decompress_ptr>(jpeg)->input_scan_number > kMaxScans) {
    throw std::runtime_error("too many scans");
  }
}

class JpegDecoder {
 public:
  explicit JpegDecoder(std::string_view bytes) {
    jpeg_.err = jpeg_std_error(&errors_);
    errors_.error_exit = ThrowError;
    errors_.emit_message = ThrowWarning;
    jpeg_create_decompress(&jpeg_);
    progress_.progress_monitor = LimitScans;
    jpeg_.progress = &progress_;
    jpeg_.mem->max_memory_to_use = kMaxWorkingBytes;
    jpeg_mem_src(&jpeg_,
                 reinterpret_cast<const unsigned char*>(bytes.data()),
                 bytes.size());
  }
  ~JpegDecoder() { jpeg_destroy_decompress(&jpeg_); }
  JpegDecoder(const JpegDecoder&) = delete;
  JpegDecoder& operator=(const JpegDecoder&) = delete;

  GreyPixels Decode() {
    jpeg_read_header(&jpeg_, TRUE);
    const std::size_t width = jpeg_.image_width;
    const std::size_t height = jpeg_.image_height;
    if (width > kMaxImageSide_px || height > kMaxImageSide_px ||
        width * height > kMaxImagePixels) {
      throw std::runtime_error("too many pixels");
    }
    jpeg_.out_color_space = JCS_GRAYSCALE;
    jpeg_.dct_method = JDCT_ISLOW;
    jpeg_start_decompress(&jpeg_);
    GreyPixels image;
    image.width_px = static_cast<int>(width);
    image.height_px = static_cast<int>(height);
    image.pixels.resize(width * height);
    while (jpeg_.output_scanline < height) {
      JSAMPROW row = image.pixels.data() + jpeg_.output_scanline * width;
      jpeg_read_scanlines(&jpeg_, &row, 1);
    }
    jpeg_finish_decompress(&jpeg_);
    return image;
  }

 private:
  jpeg_decompress_struct jpeg_ = {};
  jpeg_error_mgr errors_ = {};
  jpeg_progress_mgr progress_ = {};
};

}  // namespace

absl::StatusOr<GreyPixels> DecodeJpeg(std::string_view bytes) {
  try {
    return JpegDecoder(bytes).Decode();
  } catch (const std::exception& e) {
    return absl::DataLossError(fmt::format("not a whole JPEG: {}", e.what()));
  }
}

}  // namespace selfcal::client
