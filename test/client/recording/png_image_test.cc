#include "client/recording/png_image.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <string>

#include "test/support/files.h"
#include "test/support/temp_folder.h"

namespace selfcal::client {
namespace {

// An image whose pixels are all different from their neighbours.
cv::Mat Pattern(int type) {
  cv::Mat image(37, 53, type);
  cv::RNG(7).fill(image, cv::RNG::UNIFORM, 0, 65536);
  return image;
}

class PngImage : public testing::Test {
 protected:
  absl::StatusOr<GreyPixels> WrittenAndRead(const cv::Mat& image) {
    EXPECT_TRUE(cv::imwrite(path_, image));
    return DecodePng(ReadBytes(path_));
  }

  TempFolder folder_;
  std::string path_ = folder_.File("image.png");
};

TEST_F(PngImage, GreyOfEightBitsIsReadToTheBit) {
  const cv::Mat image = Pattern(CV_8UC1);
  const auto pixels = WrittenAndRead(image);
  ASSERT_TRUE(pixels.ok()) << pixels.status();
  EXPECT_EQ(pixels->width_px, 53);
  EXPECT_EQ(pixels->height_px, 37);
  ASSERT_EQ(pixels->pixels.size(), image.total());
  EXPECT_TRUE(
      std::equal(pixels->pixels.begin(), pixels->pixels.end(), image.data));
}

TEST_F(PngImage, GreyOfSixteenBitsIsRounded) {
  const cv::Mat image = Pattern(CV_16UC1);
  const auto pixels = WrittenAndRead(image);
  ASSERT_TRUE(pixels.ok()) << pixels.status();
  for (int i = 0; i < 37 * 53; ++i) {
    const double grey = image.at<std::uint16_t>(i / 53, i % 53) / 257.0;
    EXPECT_EQ(pixels->pixels[i], std::lround(grey)) << i;
  }
}

TEST_F(PngImage, ColoursBecomeGrey) {
  const cv::Mat image = Pattern(CV_8UC3);
  const auto pixels = WrittenAndRead(image);
  ASSERT_TRUE(pixels.ok()) << pixels.status();
  for (int i = 0; i < 37 * 53; ++i) {
    const auto& bgr = image.at<cv::Vec3b>(i / 53, i % 53);
    const double grey = 0.2126 * bgr[2] + 0.7152 * bgr[1] + 0.0722 * bgr[0];
    EXPECT_NEAR(pixels->pixels[i], grey, 1.5) << i;
  }
}

TEST_F(PngImage, FileThatIsCutOffAnywhereIsReported) {
  ASSERT_TRUE(cv::imwrite(path_, Pattern(CV_8UC1)));
  const std::string whole = ReadBytes(path_);
  for (std::size_t size = 0; size < whole.size(); size += 23) {
    const auto pixels = DecodePng(whole.substr(0, size));
    ASSERT_EQ(pixels.status().code(), absl::StatusCode::kDataLoss) << size;
    EXPECT_TRUE(std::string(pixels.status().message())
                    .starts_with("not a whole PNG: "));
  }
}

TEST_F(PngImage, DamageIsReportedAndDoesNotAbort) {
  ASSERT_TRUE(cv::imwrite(path_, Pattern(CV_8UC1)));
  const std::string whole = ReadBytes(path_);
  for (std::size_t i = 0; i < whole.size(); ++i) {
    std::string damaged = whole;
    damaged[i] = static_cast<char>(damaged[i] ^ 0x55);
    const auto pixels = DecodePng(damaged);
    // Each chunk has a checksum; that of the last one is not of pixels.
    if (i < whole.size() - 12) {
      EXPECT_FALSE(pixels.ok()) << i;
    }
  }
}

}  // namespace
}  // namespace selfcal::client
