// Files of messages, cut off or with a few flipped bits: an error or a
// recording whose images can be asked for, and never the end of the process.
#include <gtest/gtest.h>

#include <cstdint>
#include <memory>
#include <random>
#include <string>

#include "client/recording/recording.h"
#include "test/support/files.h"
#include "test/support/temp_folder.h"

namespace selfcal::client {
namespace {

constexpr int kFlips = 1200;

class Damaged : public testing::TestWithParam<std::string> {
 protected:
  // Opens the bytes and reads every image. Returns true if it is a recording.
  bool IsRecording(const std::string& bytes) {
    const std::string path = folder_.File("damaged");
    WriteBytes(path, bytes);
    const auto recording = OpenRecording(path, {});
    if (!recording.ok()) {
      EXPECT_FALSE(recording.status().message().empty());
      return false;
    }
    const auto& cameras = (*recording)->cameras();
    EXPECT_FALSE(cameras.empty());
    EXPECT_FALSE((*recording)->imu().empty());
    for (std::size_t j = 0; j < cameras.size(); ++j) {
      const auto& times_ns = cameras[j].image_times_ns;
      EXPECT_FALSE(times_ns.empty());
      for (std::size_t k = 0; k < times_ns.size(); ++k) {
        if (k > 0) {
          EXPECT_GT(times_ns[k], times_ns[k - 1]);
        }
        const auto pixels =
            (*recording)->ReadImage(static_cast<int>(j), static_cast<int>(k));
        if (pixels.ok()) {
          EXPECT_EQ(pixels->pixels.size(),
                    pixels->width_px * pixels->height_px);
        }
      }
    }
    return true;
  }

  const std::string whole_ =
      ReadBytes(std::string(SELFCAL_RECORDINGS) + "/" + GetParam());
  TempFolder folder_;
};

TEST_P(Damaged, FlippedBitsDoNoHarm) {
  ASSERT_FALSE(whole_.empty());
  std::mt19937 random(1);
  int recordings = 0;
  for (int i = 0; i < kFlips; ++i) {
    std::string bytes = whole_;
    // One bit to eight; in the first kB, where headers are, as often as
    // elsewhere.
    for (std::uint32_t n = 0; n <= i % 8u; ++n) {
      const std::size_t range =
          n % 2 == 0 ? bytes.size() : std::min<std::size_t>(bytes.size(), 1024);
      bytes[random() % range] ^= static_cast<char>(1 << random() % 8);
    }
    recordings += IsRecording(bytes);
  }
  // Some damage leaves no recording, some costs a part of it only.
  EXPECT_GT(recordings, 0);
  EXPECT_LT(recordings, kFlips);
}

TEST_P(Damaged, FileThatIsCutOffAnywhereDoesNoHarm) {
  ASSERT_FALSE(whole_.empty());
  for (std::size_t size = 0; size < whole_.size(); size += 61) {
    IsRecording(whole_.substr(0, size));
  }
  EXPECT_TRUE(IsRecording(whole_));
}

TEST_P(Damaged, NumbersOfOnesDoNoHarm) {
  ASSERT_FALSE(whole_.empty());
  for (std::size_t at = 0; at + 8 < whole_.size(); at += 37) {
    std::string bytes = whole_;
    bytes.replace(at, 8, 8, '\xff');
    IsRecording(bytes);
  }
}

INSTANTIATE_TEST_SUITE_P(All,
                         Damaged,
                         testing::Values("ros1_none.bag",
                                         "ros1_lz4.bag",
                                         "ros1_bz2.bag",
                                         "ros2_sqlite/ros2_sqlite.db3",
                                         "none.mcap",
                                         "no_chunks.mcap",
                                         "lz4.mcap",
                                         "zstd.mcap",
                                         "jpeg.mcap",
                                         "png.mcap"));

}  // namespace
}  // namespace selfcal::client
