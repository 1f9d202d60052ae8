#include "client/recording/raw_image.h"

#include <absl/status/status.h>
#include <absl/strings/escaping.h>
#include <fmt/format.h>

#include <cstdint>
#include <string>
#include <string_view>

namespace selfcal::client {
namespace {

enum class Layout { kGrey, kColours, kBayer, kEverySecond };

struct Encoding {
  std::string_view name;
  Layout layout;
  int bytes_per_pixel;
  int sample_bytes = 1;
  // Offsets of the samples in a pixel: of red and blue, or of the only one.
  int red = 0;
  int blue = 0;
};

// sensor_msgs/image_encodings.h; those of OpenCV's types are BGR.
constexpr Encoding kEncodings[] = {
    {"mono8", Layout::kGrey, 1},
    {"8UC1", Layout::kGrey, 1},
    {"mono16", Layout::kGrey, 2, 2},
    {"16UC1", Layout::kGrey, 2, 2},
    {"rgb8", Layout::kColours, 3, 1, 0, 2},
    {"bgr8", Layout::kColours, 3, 1, 2, 0},
    {"8UC3", Layout::kColours, 3, 1, 2, 0},
    {"rgba8", Layout::kColours, 4, 1, 0, 2},
    {"bgra8", Layout::kColours, 4, 1, 2, 0},
    {"8UC4", Layout::kColours, 4, 1, 2, 0},
    {"bayer_rggb8", Layout::kBayer, 1},
    {"bayer_bggr8", Layout::kBayer, 1},
    {"bayer_gbrg8", Layout::kBayer, 1},
    {"bayer_grbg8", Layout::kBayer, 1},
    {"bayer_rggb16", Layout::kBayer, 2, 2},
    {"bayer_bggr16", Layout::kBayer, 2, 2},
    {"bayer_gbrg16", Layout::kBayer, 2, 2},
    {"bayer_grbg16", Layout::kBayer, 2, 2},
    {"yuv422", Layout::kEverySecond, 2, 1, 1},
    {"uyvy", Layout::kEverySecond, 2, 1, 1},
    {"yuv422_yuy2", Layout::kEverySecond, 2},
    {"yuyv", Layout::kEverySecond, 2},
};

const Encoding* FindEncoding(std::string_view name) {
  for (const Encoding& encoding : kEncodings) {
    if (encoding.name == name) return &encoding;
  }
  return nullptr;
}

std::string AllEncodings() {
  std::string names;
  for (const Encoding& encoding : kEncodings) {
    if (!names.empty()) names += ", ";
    names += encoding.name;
  }
  return names;
}

// v / 257, rounded, as libpng does.
std::uint8_t Rounded16(std::uint32_t v) {
  return static_cast<std::uint8_t>((v * 255 + 32895) >> 16);
}

// libpng's weights for linear or sRGB colours, and its rounding.
std::uint8_t Grey(int red, int green, int blue) {
  if (red == green && red == blue) return static_cast<std::uint8_t>(red);
  return static_cast<std::uint8_t>((6968 * red + 23434 * green + 2366 * blue) >>
                                   15);
}

// Samples of an image by row and column.
class Samples {
 public:
  Samples(const RosImage& image, const Encoding& encoding)
      : image_(image), encoding_(encoding) {}

  std::uint8_t At8(int u, int v, int offset) const {
    return static_cast<std::uint8_t>(
        image_.data[Place(u, v) + static_cast<std::size_t>(offset)]);
  }
  // Values of one or two bytes, in the full range of 16 bits.
  std::uint32_t At(int u, int v) const {
    if (encoding_.sample_bytes == 1) return At8(u, v, 0);
    const std::uint32_t first = At8(u, v, 0);
    const std::uint32_t second = At8(u, v, 1);
    return image_.is_bigendian ? first << 8 | second : second << 8 | first;
  }

 private:
  std::size_t Place(int u, int v) const {
    return static_cast<std::size_t>(v) * image_.step +
           static_cast<std::size_t>(u * encoding_.bytes_per_pixel);
  }

  const RosImage& image_;
  const Encoding& encoding_;
};

// Index mirrored at the border, which keeps whether it is even.
int Mirrored(int i, int size) {
  if (i < 0) return size > 1 ? 1 : 0;
  return i < size ? i : (size > 1 ? size - 2 : 0);
}

// (1 2 1) x (1 2 1) / 16 in the samples' own range.
std::uint32_t BayerMean(
    const Samples& samples, int u, int v, int width, int height) {
  std::uint32_t sum = 0;
  for (int dv = -1; dv <= 1; ++dv) {
    for (int du = -1; du <= 1; ++du) {
      const std::uint32_t weight =
          static_cast<std::uint32_t>((2 - du * du) * (2 - dv * dv));
      sum += weight *
             samples.At(Mirrored(u + du, width), Mirrored(v + dv, height));
    }
  }
  return (sum + 8) / 16;
}

absl::Status CheckSizes(const RosImage& image, const Encoding& encoding) {
  if (image.width < 1 || image.height < 1 || image.width > kMaxImageSide_px ||
      image.height > kMaxImageSide_px ||
      std::size_t{image.width} * image.height > kMaxImagePixels) {
    return absl::DataLossError(
        fmt::format("a size of {} x {} px", image.width, image.height));
  }
  const std::size_t row = std::size_t{image.width} *
                          static_cast<std::size_t>(encoding.bytes_per_pixel);
  if (image.step < row ||
      std::size_t{image.step} * (image.height - 1) + row > image.data.size()) {
    return absl::DataLossError(
        fmt::format("{} bytes in rows of {} are not the {} x {} px of {}",
                    image.data.size(),
                    image.step,
                    image.width,
                    image.height,
                    encoding.name));
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<GreyPixels> ConvertImage(const RosImage& image) {
  const Encoding* encoding = FindEncoding(image.encoding);
  if (encoding == nullptr) {
    return absl::UnimplementedError(fmt::format(
        "the encoding '{}' is not one of {}",
        absl::Utf8SafeCHexEscape(std::string(image.encoding.substr(0, 40))),
        AllEncodings()));
  }
  const absl::Status sizes = CheckSizes(image, *encoding);
  if (!sizes.ok()) return sizes;
  GreyPixels grey;
  grey.width_px = static_cast<int>(image.width);
  grey.height_px = static_cast<int>(image.height);
  grey.pixels.reserve(std::size_t{image.width} * image.height);
  const Samples samples(image, *encoding);
  const bool deep = encoding->sample_bytes == 2;
  for (int v = 0; v < grey.height_px; ++v) {
    if (encoding->layout == Layout::kGrey && !deep) {
      const auto row = image.data.substr(
          static_cast<std::size_t>(v) * image.step, image.width);
      grey.pixels.insert(grey.pixels.end(), row.begin(), row.end());
      continue;
    }
    for (int u = 0; u < grey.width_px; ++u) {
      std::uint32_t value = 0;
      switch (encoding->layout) {
        case Layout::kGrey:
          value = samples.At(u, v);
          break;
        case Layout::kBayer:
          value = BayerMean(samples, u, v, grey.width_px, grey.height_px);
          break;
        case Layout::kEverySecond:
          value = samples.At8(u, v, encoding->red);
          break;
        case Layout::kColours:
          value = Grey(samples.At8(u, v, encoding->red),
                       samples.At8(u, v, 1),
                       samples.At8(u, v, encoding->blue));
          break;
      }
      grey.pixels.push_back(deep ? Rounded16(value)
                                 : static_cast<std::uint8_t>(value));
    }
  }
  return grey;
}

}  // namespace selfcal::client
