// One recording in every container, as write_recordings.py wrote it with
// writers of others, in SELFCAL_RECORDINGS.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "client/recording/recording.h"
#include "test/support/files.h"
#include "test/support/temp_folder.h"

namespace selfcal::client {
namespace {

namespace fs = std::filesystem;

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

// The formulas of write_recordings.py.
constexpr int kWidth = 48;
constexpr int kHeight = 36;
constexpr int kCameras = 2;
constexpr int kImages = 5;
constexpr int kReadings = 40;
constexpr std::int64_t kBegin_ns = 1'500'000'000'123'456'789;

std::int64_t ImageTime(int k) { return kBegin_ns + k * 50'000'000LL; }

std::vector<std::uint8_t> TruePixels(int camera, int image) {
  std::vector<std::uint8_t> pixels;
  for (int v = 0; v < kHeight; ++v) {
    for (int u = 0; u < kWidth; ++u) {
      pixels.push_back(static_cast<std::uint8_t>(7 * u + 13 * v + (u * v) % 17 +
                                                 31 * image + 59 * camera));
    }
  }
  return pixels;
}

std::string PathOf(const std::string& name) {
  return std::string(SELFCAL_RECORDINGS) + "/" + name;
}

absl::StatusOr<std::unique_ptr<Recording>> Open(
    const std::string& name, const RecordingOptions& options = {}) {
  return OpenRecording(PathOf(name), options);
}

std::string ErrorOf(const std::string& name,
                    const RecordingOptions& options = {}) {
  return std::string(Open(name, options).status().message());
}

void ExpectTrueReadings(const Recording& recording) {
  ASSERT_EQ(recording.imu().size(), kReadings);
  for (int i = 0; i < kReadings; ++i) {
    const ImuSample& sample = recording.imu()[i];
    EXPECT_EQ(sample.t_ns, kBegin_ns + i * 5'000'000LL);
    for (int j = 0; j < 3; ++j) {
      EXPECT_EQ(sample.gyro[j], (10 * i + j) * 0.001);
      EXPECT_EQ(sample.accel[j], (10 * i + j + 3) * 0.001);
    }
  }
}

void ExpectTrueImages(Recording* recording) {
  ASSERT_EQ(recording->cameras().size(), kCameras);
  for (int j = 0; j < kCameras; ++j) {
    const std::vector<std::int64_t>& times_ns =
        recording->cameras()[j].image_times_ns;
    ASSERT_EQ(times_ns.size(), kImages);
    for (int k = 0; k < kImages; ++k) {
      EXPECT_EQ(times_ns[k], ImageTime(k));
      const auto pixels = recording->ReadImage(j, k);
      ASSERT_TRUE(pixels.ok()) << pixels.status();
      EXPECT_EQ(pixels->width_px, kWidth);
      EXPECT_EQ(pixels->height_px, kHeight);
      EXPECT_EQ(pixels->pixels, TruePixels(j, k));
    }
  }
}

class Container : public testing::TestWithParam<std::string> {};

TEST_P(Container, HasTheSameBits) {
  const auto recording = Open(GetParam());
  ASSERT_TRUE(recording.ok()) << recording.status();
  EXPECT_THAT((*recording)->problems(), IsEmpty());
  ExpectTrueReadings(**recording);
  ExpectTrueImages(recording->get());
  // Backwards, too: from the last one to the first.
  for (int k = kImages; k-- > 0;) {
    EXPECT_EQ((*recording)->ReadImage(1, k)->pixels, TruePixels(1, k));
  }
}

INSTANTIATE_TEST_SUITE_P(All,
                         Container,
                         testing::Values("euroc",
                                         "euroc/mav0",
                                         "tum_vi",
                                         "csv",
                                         "ros1_none.bag",
                                         "ros1_lz4.bag",
                                         "ros1_bz2.bag",
                                         "ros1_png.bag",
                                         "ros2_sqlite",
                                         "ros2_sqlite/ros2_sqlite.db3",
                                         "ros2_mcap",
                                         "ros2_mcap_zstd",
                                         "none.mcap",
                                         "lz4.mcap",
                                         "zstd.mcap",
                                         "no_chunks.mcap",
                                         "no_index.mcap",
                                         "big_endian.mcap",
                                         "ros1.mcap",
                                         "png.mcap"));

class Bag : public testing::TestWithParam<std::string> {};

TEST_P(Bag, HasTopicsAndTheCalibrationOfTheirCameraInfo) {
  const auto recording = Open(GetParam());
  ASSERT_TRUE(recording.ok()) << recording.status();
  const RecordedCamera& left = (*recording)->cameras()[0];
  EXPECT_EQ(left.name, "/cam0/image_raw");
  EXPECT_EQ((*recording)->cameras()[1].name, "/cam1/image_raw");
  EXPECT_FALSE((*recording)->cameras()[1].calibration);
  ASSERT_TRUE(left.calibration);
  EXPECT_FALSE(left.has_pose);
  EXPECT_EQ(left.calibration->f, Eigen::Vector2d(40.5, 41.5));
  EXPECT_EQ(left.calibration->c, Eigen::Vector2d(23.5, 17.5));
  EXPECT_EQ(left.calibration->model, DistortionModel::kRadialTangential);
  EXPECT_EQ(left.calibration->distortion,
            Eigen::Vector4d(-0.25, 0.0625, 0.001, 0.002));
  EXPECT_EQ(left.calibration->width_px, kWidth);
  EXPECT_EQ(left.calibration->height_px, kHeight);
}

INSTANTIATE_TEST_SUITE_P(All,
                         Bag,
                         testing::Values("ros1_none.bag",
                                         "ros1_lz4.bag",
                                         "ros2_sqlite",
                                         "zstd.mcap",
                                         "big_endian.mcap",
                                         "ros1.mcap"));

TEST(BagCalibration, OfAnotherModelIsRead) {
  const auto recording = Open("equidistant.mcap");
  ASSERT_TRUE(recording.ok()) << recording.status();
  const auto& calibration = (*recording)->cameras()[0].calibration;
  ASSERT_TRUE(calibration);
  EXPECT_EQ(calibration->model, DistortionModel::kEquidistant);
  EXPECT_EQ(calibration->distortion, Eigen::Vector4d(0.1, 0.02, 0.003, 4e-4));
}

TEST(BagCalibration, ThatCannotBeUsedIsNamedWithTheReason) {
  const std::string expected[][2] = {
      {"uncalibrated.mcap", "the camera is not calibrated"},
      {"binned.mcap",
       "the images are binned, or a part of what was calibrated"},
      {"unknown_model.mcap", "distortion_model 'brown_2' is not one of "}};
  for (const auto& [name, reason] : expected) {
    const auto recording = Open(name);
    ASSERT_TRUE(recording.ok()) << recording.status();
    EXPECT_FALSE((*recording)->cameras()[0].calibration);
    ASSERT_EQ((*recording)->problems().size(), 1u);
    EXPECT_THAT((*recording)->problems()[0],
                HasSubstr(name + ": /cam0/camera_info is not used: "));
    EXPECT_THAT((*recording)->problems()[0], HasSubstr(reason));
    ExpectTrueImages(recording->get());
  }
}

TEST(BagImages, OfJpegAreThoseOfAnotherDecoder) {
  const auto recording = Open("jpeg.mcap");
  ASSERT_TRUE(recording.ok()) << recording.status();
  EXPECT_EQ((*recording)->cameras()[0].name, "/cam0/image_raw/compressed");
  for (int j = 0; j < kCameras; ++j) {
    for (int k = 0; k < kImages; ++k) {
      const std::string truth = ReadBytes(PathOf(
          "jpeg_" + std::to_string(j) + "_" + std::to_string(k) + ".raw"));
      const auto pixels = (*recording)->ReadImage(j, k);
      ASSERT_TRUE(pixels.ok()) << pixels.status();
      ASSERT_EQ(truth.size(), kWidth * kHeight);
      EXPECT_EQ(std::string(pixels->pixels.begin(), pixels->pixels.end()),
                truth);
    }
  }
}

TEST(BagTopics, RawImagesArePreferredToTheirCompressedOnes) {
  const auto recording = Open("raw_and_png.mcap");
  ASSERT_TRUE(recording.ok()) << recording.status();
  ExpectTrueImages(recording->get());
  EXPECT_EQ((*recording)->cameras()[0].name, "/cam0/image_raw");
  EXPECT_THAT((*recording)->problems(),
              ElementsAre(PathOf("raw_and_png.mcap") +
                              ": /cam0/image_raw/compressed is not read: "
                              "/cam0/image_raw has its images uncompressed",
                          PathOf("raw_and_png.mcap") +
                              ": /cam1/image_raw/compressed is not read: "
                              "/cam1/image_raw has its images uncompressed"));
}

TEST(BagTopics, StatedOnesAreUsedInTheirOrder) {
  const auto recording =
      Open("raw_and_png.mcap",
           {{"/cam1/image_raw/compressed", "/cam0/image_raw"}, {"/imu0"}});
  ASSERT_TRUE(recording.ok()) << recording.status();
  EXPECT_THAT((*recording)->problems(), IsEmpty());
  ASSERT_EQ((*recording)->cameras().size(), 2u);
  EXPECT_EQ((*recording)->cameras()[0].name, "/cam1/image_raw/compressed");
  EXPECT_EQ((*recording)->ReadImage(0, 3)->pixels, TruePixels(1, 3));
  EXPECT_EQ((*recording)->ReadImage(1, 3)->pixels, TruePixels(0, 3));
}

TEST(BagTopics, TwoImusAreAnErrorUntilOneIsStated) {
  EXPECT_EQ(ErrorOf("two_imus.mcap"),
            PathOf("two_imus.mcap") +
                ": there are 2 topics with readings of an IMU, /imu0, /imu1: "
                "state one with --imu-topic");
  const auto recording = Open("two_imus.mcap", {{}, {"/imu1"}});
  ASSERT_TRUE(recording.ok()) << recording.status();
  ExpectTrueReadings(**recording);
  EXPECT_THAT((*recording)->imu1(), IsEmpty());
}

TEST(BagTopics, TheSecondOneThatIsStatedIsOfASecondImu) {
  const auto recording = Open("two_imus.mcap", {{}, {"/imu1", "/imu0"}});
  ASSERT_TRUE(recording.ok()) << recording.status();
  ExpectTrueReadings(**recording);
  ASSERT_EQ((*recording)->imu1().size(), kReadings);
  EXPECT_EQ((*recording)->imu1().back().gyro, (*recording)->imu().back().gyro);
  EXPECT_THAT(ErrorOf("two_imus.mcap", {{}, {"/imu0", "/imu0"}}),
              HasSubstr("two different ones"));
  EXPECT_THAT(ErrorOf("two_imus.mcap", {{}, {"/imu0", "/imu2"}}),
              HasSubstr("there are no readings in /imu2"));
}

TEST(BagTopics, MissingOnesAreNamed) {
  EXPECT_EQ(ErrorOf("no_imu.mcap"),
            PathOf("no_imu.mcap") + ": there are no readings of an IMU in it");
  EXPECT_EQ(ErrorOf("no_images.mcap"),
            PathOf("no_images.mcap") + ": there are no images in it");
  EXPECT_EQ(ErrorOf("none.mcap", {{"/left"}, {}}),
            PathOf("none.mcap") +
                ": there are no images in /left; topics with images: "
                "/cam0/image_raw, /cam1/image_raw");
  EXPECT_EQ(ErrorOf("none.mcap", {{}, {"/imu"}}),
            PathOf("none.mcap") +
                ": there are no readings in /imu; topics with readings: /imu0");
}

TEST(BagOrder, IsThatOfTimeAndSecondMessagesOfATimeAreLeftOut) {
  const auto recording = Open("disorder.bag");
  ASSERT_TRUE(recording.ok()) << recording.status();
  ExpectTrueReadings(**recording);
  ExpectTrueImages(recording->get());
  const std::string path = PathOf("disorder.bag");
  // Images 1 and 2 of camera 0 are swapped, and image 3 comes twice; so do
  // readings 7 and 9, and 3.
  EXPECT_THAT(
      (*recording)->problems(),
      ElementsAre(path + ": /cam0/image_raw: 2 of 6 images are earlier than "
                         "one before them: sorted by time",
                  path + ": /cam0/image_raw: 1 of 6 images have the timestamp "
                         "of another one: left out",
                  path + ": /imu0: 3 of 41 readings are earlier than one "
                         "before them: sorted by time",
                  path + ": /imu0: 1 of 41 readings have the timestamp of "
                         "another one: left out"));
}

TEST(BagFolder, CompressedOnesAreNamedWithWhatToDo) {
  EXPECT_EQ(ErrorOf("ros2_file_zstd"),
            PathOf("ros2_file_zstd/ros2_file_zstd.db3.zstd") +
                ": compressed as a whole: decompress it with `zstd -d`");
  EXPECT_EQ(ErrorOf("ros2_message_zstd"),
            PathOf("ros2_message_zstd/metadata.yaml") +
                ": its messages are compressed one by one: convert it with "
                "`ros2 bag convert`");
}

class BrokenBag : public testing::Test {
 protected:
  std::string Write(const std::string& name, const std::string& bytes) {
    WriteBytes(folder_.File(name), bytes);
    return folder_.File(name);
  }
  std::string Error(const std::string& path) {
    return std::string(OpenRecording(path, {}).status().message());
  }

  TempFolder folder_;
};

TEST_F(BrokenBag, FolderWithoutMetadataHasOneFile) {
  fs::copy(PathOf("ros2_sqlite/ros2_sqlite.db3"), folder_.path() / "a.db3");
  const auto recording = OpenRecording(folder_.path(), {});
  ASSERT_TRUE(recording.ok()) << recording.status();
  ExpectTrueImages(recording->get());
  fs::copy(PathOf("none.mcap"), folder_.path() / "b.mcap");
  EXPECT_EQ(
      Error(folder_.path()),
      folder_.path().string() +
          ": has 2 bags and no metadata.yaml: state the file of one, as " +
          folder_.File("a.db3"));
}

TEST_F(BrokenBag, FilesOfASplitBagBelongTogether) {
  fs::copy(PathOf("no_imu.mcap"), folder_.path() / "walk_0.mcap");
  fs::copy(PathOf("no_images.mcap"), folder_.path() / "walk_1.mcap");
  const std::string list =
      "rosbag2_bagfile_information:\n"
      "  relative_file_paths:\n"
      "    - walk_0.mcap\n"
      "    - walk/walk_1.mcap\n";
  Write("metadata.yaml", list);
  auto recording = OpenRecording(folder_.path(), {});
  ASSERT_TRUE(recording.ok()) << recording.status();
  EXPECT_THAT((*recording)->problems(), IsEmpty());
  ExpectTrueReadings(**recording);
  ExpectTrueImages(recording->get());
  Write("metadata.yaml", list + "    - walk_2.mcap\n");
  recording = OpenRecording(folder_.path(), {});
  ASSERT_TRUE(recording.ok()) << recording.status();
  EXPECT_THAT((*recording)->problems(),
              ElementsAre(folder_.File("walk_2.mcap") + ": cannot be opened"));
  Write("metadata.yaml", "rosbag2_bagfile_information: [");
  EXPECT_THAT(Error(folder_.path()),
              HasSubstr(folder_.File("metadata.yaml") + ": yaml-cpp: error"));
  Write("metadata.yaml", "other: 1");
  EXPECT_EQ(Error(folder_.path()),
            folder_.File("metadata.yaml") + ": lists no file");
}

TEST_F(BrokenBag, OtherFilesAreNoRecordings) {
  EXPECT_EQ(Error(folder_.File("nothing")),
            folder_.File("nothing") + ": there is no such file or folder");
  EXPECT_EQ(Error(folder_.path()),
            folder_.path().string() +
                ": not a recording: the folder has neither mav0 nor cam0.csv "
                "nor tracks.csv nor a bag");
  for (const std::string bytes : {"", "#ROSBAG", "timestamp,gyro\n1,2\n"}) {
    EXPECT_EQ(Error(Write("file", bytes)),
              folder_.File("file") +
                  ": not a recording: neither a bag of ROS 1 nor MCAP nor "
                  "SQLite");
  }
  for (const std::string lines :
       {"# timestamp tx ty tz qx qy qz qw\n1403715273.26 1 2 3 0 0 0 1\n",
        "1403715273262142976,1,2,3,1,0,0,0,0.1,0.2,0.3\n"}) {
    EXPECT_EQ(Error(Write("file", lines)),
              folder_.File("file") +
                  ": a trajectory, which has neither images nor tracks: name "
                  "the recording from which it was estimated");
  }
  EXPECT_EQ(Error(Write("file", "#ROSBAG V1.2\n")),
            folder_.File("file") +
                ": a bag of version 1: only version 2.0, of 2010, is read");
}

TEST_F(BrokenBag, CutOffFileIsReadAsFarAsItGoes) {
  for (const std::string name : {"none.mcap",
                                 "no_chunks.mcap",
                                 "ros1_none.bag",
                                 "lz4.mcap",
                                 "ros1_bz2.bag"}) {
    const std::string whole = ReadBytes(PathOf(name));
    const std::string path = Write(name, whole.substr(0, whole.size() / 2));
    const auto recording = OpenRecording(path, {});
    ASSERT_TRUE(recording.ok()) << recording.status();
    ASSERT_EQ((*recording)->problems().size(), 1u) << name;
    EXPECT_THAT((*recording)->problems()[0],
                HasSubstr(path + ": cut off or damaged at byte "));
    EXPECT_LT((*recording)->imu().size(), kReadings);
    EXPECT_GE((*recording)->cameras()[0].image_times_ns.size(), 1u);
    EXPECT_EQ((*recording)->ReadImage(0, 0)->pixels, TruePixels(0, 0));
  }
}

// The first one, which has the only definitions of topics but for the index.
TEST_F(BrokenBag, DamagedChunkIsLeftOut) {
  const std::string expected[][3] = {
      {"zstd.mcap", "\x28\xb5\x2f\xfd", "its checksum is another one"},
      {"ros1_lz4.bag", "\x04\x22\x4d\x18", "ERROR_"}};
  for (const auto& [name, magic, reason] : expected) {
    std::string bytes = ReadBytes(PathOf(name));
    const std::size_t content = bytes.find(magic);
    ASSERT_NE(content, std::string::npos);
    // MCAP's checksum, before the name, its length and that of the content; or
    // the description of the lz4 frame.
    bytes[name == "zstd.mcap" ? content - 8 - 4 - 4 - 4 : content + 4] ^= 1;
    const auto recording = OpenRecording(Write(name, bytes), {});
    ASSERT_TRUE(recording.ok()) << recording.status();
    ASSERT_EQ((*recording)->problems().size(), 1u);
    EXPECT_THAT(
        (*recording)->problems()[0],
        HasSubstr(": chunks that are damaged are left out, or their rest: "
                  "1, at byte "));
    EXPECT_THAT((*recording)->problems()[0], HasSubstr(reason));
    EXPECT_LT((*recording)->imu().size(), kReadings);
    const RecordedCamera& camera = (*recording)->cameras()[1];
    const int images = static_cast<int>(camera.image_times_ns.size());
    ASSERT_GE(images, 1);
    EXPECT_EQ(camera.image_times_ns.back(), ImageTime(kImages - 1));
    EXPECT_EQ((*recording)->ReadImage(1, images - 1)->pixels,
              TruePixels(1, kImages - 1));
  }
}

TEST_F(BrokenBag, FileThatBecomesShorterIsReported) {
  const std::string path =
      Write("no_chunks.mcap", ReadBytes(PathOf("no_chunks.mcap")));
  const auto recording = OpenRecording(path, {});
  ASSERT_TRUE(recording.ok()) << recording.status();
  fs::resize_file(path, 1000);
  const auto pixels = (*recording)->ReadImage(0, kImages - 1);
  EXPECT_EQ(pixels.status().code(), absl::StatusCode::kDataLoss);
  EXPECT_THAT(std::string(pixels.status().message()),
              HasSubstr("it has become shorter"));
}

}  // namespace
}  // namespace selfcal::client
