#include "client/recording/raw_image.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <png.h>

#include <cmath>
#include <random>
#include <string>
#include <string_view>

#include "client/recording/png_image.h"

namespace selfcal::client {
namespace {

using testing::Each;
using testing::ElementsAre;

std::string RandomBytes(std::size_t size) {
  std::mt19937 random(1);
  std::string bytes;
  for (std::size_t i = 0; i < size; ++i) {
    bytes.push_back(static_cast<char>(random()));
  }
  return bytes;
}

RosImage Image(int width,
               int height,
               std::string_view encoding,
               int bytes_per_pixel,
               std::string_view data) {
  return {static_cast<std::uint32_t>(height),
          static_cast<std::uint32_t>(width),
          encoding,
          false,
          static_cast<std::uint32_t>(width * bytes_per_pixel),
          data};
}

std::vector<std::uint8_t> Converted(const RosImage& image) {
  const auto pixels = ConvertImage(image);
  EXPECT_TRUE(pixels.ok()) << pixels.status();
  return pixels.ok() ? pixels->pixels : std::vector<std::uint8_t>();
}

// Reads a PNG of these pixels.
std::vector<std::uint8_t> AsPng(const std::string& data,
                                int width,
                                int height,
                                png_uint_32 format) {
  png_image image = {};
  image.version = PNG_IMAGE_VERSION;
  image.width = static_cast<png_uint_32>(width);
  image.height = static_cast<png_uint_32>(height);
  image.format = format;
  png_alloc_size_t size = 0;
  png_image_write_to_memory(&image, nullptr, &size, 0, data.data(), 0, nullptr);
  std::string bytes(size, '\0');
  png_image_write_to_memory(
      &image, bytes.data(), &size, 0, data.data(), 0, nullptr);
  return DecodePng(bytes)->pixels;
}

TEST(RawImage, ColoursAreThoseOfAPngToTheBit) {
  const std::string three = RandomBytes(64 * 50 * 3);
  EXPECT_EQ(Converted(Image(64, 50, "rgb8", 3, three)),
            AsPng(three, 64, 50, PNG_FORMAT_RGB));
  EXPECT_EQ(Converted(Image(64, 50, "bgr8", 3, three)),
            AsPng(three, 64, 50, PNG_FORMAT_BGR));
  const std::string four = RandomBytes(64 * 50 * 4);
  EXPECT_EQ(Converted(Image(64, 50, "rgba8", 4, four)),
            AsPng(four, 64, 50, PNG_FORMAT_RGBA));
  EXPECT_EQ(Converted(Image(64, 50, "bgra8", 4, four)),
            AsPng(four, 64, 50, PNG_FORMAT_BGRA));
  const std::string grey(3 * 4, '\x65');
  EXPECT_THAT(Converted(Image(2, 2, "rgb8", 3, grey)), Each(0x65));
}

TEST(RawImage, SixteenBitsAreRounded) {
  std::string little;
  std::string big;
  for (int v = 0; v < 65536; ++v) {
    little += {static_cast<char>(v), static_cast<char>(v >> 8)};
    big += {static_cast<char>(v >> 8), static_cast<char>(v)};
  }
  RosImage image = Image(256, 256, "mono16", 2, little);
  const std::vector<std::uint8_t> pixels = Converted(image);
  for (int v = 0; v < 65536; ++v) {
    ASSERT_EQ(pixels[v], std::lround(v / 257.0)) << v;
  }
  image = Image(256, 256, "16UC1", 2, big);
  image.is_bigendian = true;
  EXPECT_EQ(Converted(image), pixels);
}

TEST(RawImage, BayerIsTheMeanOfItsColoursAnywhere) {
  for (const std::string pattern : {"rggb", "bggr", "gbrg", "grbg"}) {
    std::string data;
    std::string deep;
    for (int v = 0; v < 6; ++v) {
      for (int u = 0; u < 8; ++u) {
        const char colour = pattern[2 * (v % 2) + u % 2];
        const int value = colour == 'r' ? 40 : colour == 'g' ? 100 : 160;
        data.push_back(static_cast<char>(value));
        deep += {static_cast<char>(value), static_cast<char>(value)};
      }
    }
    const std::string name = "bayer_" + pattern;
    EXPECT_THAT(Converted(Image(8, 6, name + "8", 1, data)), Each(100));
    EXPECT_THAT(Converted(Image(8, 6, name + "16", 2, deep)), Each(100));
  }
}

// A ramp stays where it is: the kernel has no shift.
TEST(RawImage, BayerMovesNothing) {
  std::string data;
  for (int v = 0; v < 5; ++v) {
    for (int u = 0; u < 9; ++u) {
      data.push_back(static_cast<char>(16 * u + 2 * v));
    }
  }
  const auto pixels = Converted(Image(9, 5, "bayer_rggb8", 1, data));
  for (int v = 1; v < 4; ++v) {
    for (int u = 1; u < 8; ++u) {
      EXPECT_EQ(pixels[9 * v + u], 16 * u + 2 * v);
    }
  }
  EXPECT_EQ(Converted(Image(1, 1, "bayer_rggb8", 1, "a"))[0], 'a');
}

TEST(RawImage, YuvIsItsLuma) {
  EXPECT_THAT(Converted(Image(2, 1, "yuv422", 2, "uYvZ")),
              ElementsAre('Y', 'Z'));
  EXPECT_THAT(Converted(Image(2, 1, "yuv422_yuy2", 2, "YuZv")),
              ElementsAre('Y', 'Z'));
}

TEST(RawImage, SizesThatDoNotFitAreReported) {
  const std::string data(12, 'a');
  EXPECT_EQ(ConvertImage(Image(4, 4, "mono8", 1, data)).status().message(),
            "12 bytes in rows of 4 are not the 4 x 4 px of mono8");
  RosImage image = Image(4, 3, "mono8", 1, data);
  image.step = 3;
  EXPECT_EQ(ConvertImage(image).status().code(), absl::StatusCode::kDataLoss);
  image.step = 0xffffffff;
  EXPECT_EQ(ConvertImage(image).status().code(), absl::StatusCode::kDataLoss);
  for (const std::uint32_t side : {0u, 16385u, 0xffffffffu}) {
    image = Image(4, 3, "mono8", 1, data);
    image.width = side;
    EXPECT_EQ(ConvertImage(image).status().code(), absl::StatusCode::kDataLoss);
    std::swap(image.width, image.height);
    EXPECT_EQ(ConvertImage(image).status().code(), absl::StatusCode::kDataLoss);
  }
}

TEST(RawImage, UnknownEncodingIsNamed) {
  const auto pixels = ConvertImage(Image(1, 1, "32FC1", 4, "abcd"));
  EXPECT_EQ(pixels.status().code(), absl::StatusCode::kUnimplemented);
  EXPECT_THAT(std::string(pixels.status().message()),
              testing::StartsWith(
                  "the encoding '32FC1' is not one of mono8, 8UC1, mono16, "));
}

}  // namespace
}  // namespace selfcal::client
