#include "client/recording/jpeg_image.h"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <random>
#include <string>
#include <vector>

namespace selfcal::client {
namespace {

// Smooth, as JPEG wants it, with different colours.
cv::Mat Photo(int type) {
  cv::Mat small(5, 7, type);
  cv::RNG(3).fill(small, cv::RNG::UNIFORM, 0, 256);
  cv::Mat image;
  cv::resize(small, image, {53, 37}, 0, 0, cv::INTER_CUBIC);
  return image;
}

std::string Encoded(const cv::Mat& image, const std::vector<int>& options) {
  std::vector<std::uint8_t> bytes;
  EXPECT_TRUE(cv::imencode(".jpg", image, bytes, options));
  return {bytes.begin(), bytes.end()};
}

TEST(JpegImage, IsWhatAnotherDecoderMakesOfIt) {
  for (const int type : {CV_8UC1, CV_8UC3}) {
    for (const int progressive : {0, 1}) {
      const std::string bytes = Encoded(Photo(type),
                                        {cv::IMWRITE_JPEG_QUALITY,
                                         90,
                                         cv::IMWRITE_JPEG_PROGRESSIVE,
                                         progressive});
      const auto pixels = DecodeJpeg(bytes);
      ASSERT_TRUE(pixels.ok()) << pixels.status();
      const std::vector<std::uint8_t> copy(bytes.begin(), bytes.end());
      const cv::Mat grey = cv::imdecode(copy, cv::IMREAD_GRAYSCALE);
      ASSERT_EQ(pixels->width_px, grey.cols);
      ASSERT_EQ(pixels->height_px, grey.rows);
      EXPECT_TRUE(
          std::equal(pixels->pixels.begin(), pixels->pixels.end(), grey.data));
    }
  }
}

TEST(JpegImage, ColoursBecomeTheirLuma) {
  const cv::Mat image = Photo(CV_8UC3);
  const auto pixels =
      DecodeJpeg(Encoded(image, {cv::IMWRITE_JPEG_QUALITY, 100}));
  ASSERT_TRUE(pixels.ok()) << pixels.status();
  for (int i = 0; i < 37 * 53; ++i) {
    const auto& bgr = image.at<cv::Vec3b>(i / 53, i % 53);
    const double luma = 0.299 * bgr[2] + 0.587 * bgr[1] + 0.114 * bgr[0];
    EXPECT_NEAR(pixels->pixels[i], luma, 2.5) << i;
  }
}

TEST(JpegImage, ThatIsCutOffAnywhereIsReported) {
  const std::string whole = Encoded(Photo(CV_8UC1), {});
  ASSERT_TRUE(DecodeJpeg(whole).ok());
  // Nothing misses the marker of the end, of two bytes.
  for (std::size_t size = 0; size + 2 < whole.size(); ++size) {
    const auto pixels = DecodeJpeg(whole.substr(0, size));
    ASSERT_EQ(pixels.status().code(), absl::StatusCode::kDataLoss) << size;
    EXPECT_TRUE(std::string(pixels.status().message())
                    .starts_with("not a whole JPEG: "));
  }
}

TEST(JpegImage, PaddingOfWebcamsIsNoDamage) {
  const std::string whole = Encoded(Photo(CV_8UC1), {});
  const auto padded = DecodeJpeg(whole + std::string(64, '\0'));
  ASSERT_TRUE(padded.ok()) << padded.status();
  EXPECT_EQ(padded->pixels, DecodeJpeg(whole)->pixels);
}

TEST(JpegImage, DamageDoesNotAbort) {
  const std::string whole =
      Encoded(Photo(CV_8UC3), {cv::IMWRITE_JPEG_PROGRESSIVE, 1});
  std::mt19937 random(1);
  int failed = 0;
  for (int i = 0; i < 5000; ++i) {
    std::string damaged = whole;
    damaged[random() % whole.size()] ^= static_cast<char>(1 << random() % 8);
    const auto pixels = DecodeJpeg(damaged);
    failed += !pixels.ok();
    if (pixels.ok()) {
      EXPECT_EQ(pixels->pixels.size(), pixels->width_px * pixels->height_px);
    }
  }
  EXPECT_GT(failed, 500);
}

TEST(JpegImage, SizesBeyondTheLimitsAreRefused) {
  std::string bytes = Encoded(Photo(CV_8UC1), {});
  const std::size_t frame = bytes.find("\xff\xc0");
  ASSERT_NE(frame, std::string::npos);
  // Behind the marker, the length and the precision: height, width.
  bytes.replace(frame + 5, 4, "\x3f\xff\x3f\xff");
  const auto pixels = DecodeJpeg(bytes);
  EXPECT_EQ(std::string(pixels.status().message()),
            "not a whole JPEG: too many pixels");
}

}  // namespace
}  // namespace selfcal::client
