#include "client/recording/euroc_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <set>
#include <string>
#include <vector>

#include "client/recording/recording.h"
#include "client/tracking/feature_tracker.h"
#include "test/core/simulation/rigs.h"
#include "test/recordings.h"
#include "test/rendering/euroc_folder.h"
#include "test/support/files.h"
#include "test/support/temp_folder.h"

namespace selfcal::client {
namespace {

namespace fs = std::filesystem;

using testing::ElementsAre;

// Tracks through all images of a recording that was opened.
std::vector<TrackPoint> TrackAll(Recording& recording,
                                 const Calibration& theta) {
  FeatureTracker tracker(theta, {});
  for (const ImuSample& sample : recording.imu()) tracker.AddImu(sample);
  std::vector<TrackPoint> all;
  for (const ImageSet& set : ImageSets(recording)) {
    std::vector<GreyPixels> pixels(recording.cameras().size());
    std::vector<cv::Mat> images(recording.cameras().size());
    for (std::size_t j = 0; j < images.size(); ++j) {
      if (set.images[j] < 0) continue;
      auto read = recording.ReadImage(static_cast<int>(j), set.images[j]);
      EXPECT_TRUE(read.ok()) << read.status();
      if (!read.ok()) continue;
      pixels[j] = *std::move(read);
      images[j] = cv::Mat(pixels[j].height_px,
                          pixels[j].width_px,
                          CV_8UC1,
                          pixels[j].pixels.data());
    }
    for (const TrackPoint& point : tracker.Track(set.t_ns, images)) {
      all.push_back(point);
    }
  }
  return all;
}

class EurocReader : public testing::Test {
 protected:
  // One recording for all tests, which copy it before they break it.
  static void SetUpTestSuite() {
    whole_ = new TempFolder();
    rendered_ = new RenderedRecording(StereoRig(), MakeHandheld(0.4, 1, 1), {});
    WriteEurocFolder(*rendered_, rendered_->rig().factory, whole_->path());
  }
  static void TearDownTestSuite() {
    delete rendered_;
    delete whole_;
  }

  fs::path Copy() {
    fs::copy(whole_->path() / "mav0",
             copy_.path() / "mav0",
             fs::copy_options::recursive);
    return copy_.path() / "mav0";
  }
  // Opens a copy in which a text of a file is replaced.
  absl::StatusOr<std::unique_ptr<Recording>> OpenWith(const std::string& file,
                                                      const std::string& from,
                                                      const std::string& to) {
    const fs::path path = Copy() / file;
    std::string text = ReadBytes(path);
    const std::size_t at = text.find(from);
    EXPECT_NE(at, std::string::npos);
    WriteBytes(path, text.replace(at, from.size(), to));
    return OpenRecording(copy_.path(), {});
  }
  static std::string Stamp(int image) {
    return std::to_string(kEurocEpoch_ns + rendered_->stamp_ns(image));
  }

  static TempFolder* whole_;
  static RenderedRecording* rendered_;
  TempFolder copy_;
};

TempFolder* EurocReader::whole_ = nullptr;
RenderedRecording* EurocReader::rendered_ = nullptr;

TEST_F(EurocReader, WhatWasWrittenIsReadToTheBit) {
  const auto recording = OpenRecording(whole_->path(), {});
  ASSERT_TRUE(recording.ok()) << recording.status();
  ASSERT_EQ((*recording)->cameras().size(), 2u);
  for (int j = 0; j < 2; ++j) {
    const RecordedCamera& camera = (*recording)->cameras()[j];
    EXPECT_EQ(camera.name, "cam" + std::to_string(j));
    ASSERT_EQ(camera.image_times_ns.size(), rendered_->images());
    for (int k = 0; k < rendered_->images(); ++k) {
      EXPECT_EQ(camera.image_times_ns[k],
                kEurocEpoch_ns + rendered_->stamp_ns(k));
      const auto pixels = (*recording)->ReadImage(j, k);
      ASSERT_TRUE(pixels.ok()) << pixels.status();
      EXPECT_EQ(pixels->pixels, rendered_->Image(j, k).pixels);
    }
    const CameraCalibration& truth = rendered_->rig().factory.cameras[j];
    ASSERT_TRUE(camera.calibration);
    EXPECT_TRUE(camera.has_pose);
    EXPECT_EQ(camera.calibration->f, truth.f);
    EXPECT_EQ(camera.calibration->model, truth.model);
    EXPECT_EQ(camera.calibration->distortion, truth.distortion);
    EXPECT_LT(camera.calibration->q_CI.angularDistance(truth.q_CI), 1e-9);
    EXPECT_LT((camera.calibration->p_CI - truth.p_CI).norm(), 1e-9);
  }
  const auto& written = rendered_->imu().measured;
  ASSERT_EQ((*recording)->imu().size(), written.size());
  for (std::size_t i = 0; i < written.size(); ++i) {
    EXPECT_EQ((*recording)->imu()[i].t_ns, kEurocEpoch_ns + written[i].t_ns);
    EXPECT_EQ((*recording)->imu()[i].gyro, written[i].gyro);
    EXPECT_EQ((*recording)->imu()[i].accel, written[i].accel);
  }
}

TEST_F(EurocReader, ImagesOfOneTimeBelongTogether) {
  const auto recording =
      OpenWith("cam1/data.csv", Stamp(1) + "," + Stamp(1) + ".png\n", "");
  ASSERT_TRUE(recording.ok()) << recording.status();
  const std::vector<ImageSet> sets = ImageSets(**recording);
  ASSERT_EQ(sets.size(), rendered_->images());
  EXPECT_EQ(sets[0].images, std::vector<int>({0, 0}));
  EXPECT_EQ(sets[1].images, std::vector<int>({1, -1}));
  EXPECT_EQ(sets[2].images, std::vector<int>({2, 1}));
}

// The second camera is stamped later, by less in one image than in another.
TEST_F(EurocReader, ImagesOfNearlyOneTimeBelongTogether) {
  const fs::path list = Copy() / "cam1" / "data.csv";
  std::string text = "#timestamp,filename\n";
  for (int k = 0; k < rendered_->images(); ++k) {
    const std::int64_t late_ns = k % 2 == 0 ? 300'000 : 1'900'000;
    text += std::to_string(kEurocEpoch_ns + rendered_->stamp_ns(k) + late_ns) +
            "," + Stamp(k) + ".png\n";
  }
  WriteBytes(list, text);
  const auto recording = OpenRecording(copy_.path(), {});
  ASSERT_TRUE(recording.ok()) << recording.status();
  const std::vector<ImageSet> sets = ImageSets(**recording);
  ASSERT_EQ(sets.size(), rendered_->images());
  for (int k = 0; k < rendered_->images(); ++k) {
    EXPECT_EQ(sets[k].images, std::vector<int>({k, k}));
    EXPECT_EQ(sets[k].t_ns, kEurocEpoch_ns + rendered_->stamp_ns(k));
  }
  const auto differences = StampDifferences(**recording);
  ASSERT_TRUE(differences);
  EXPECT_THAT(*differences, testing::HasSubstr("at most 1.900 ms"));
  const auto whole = OpenRecording(whole_->path(), {});
  ASSERT_TRUE(whole.ok()) << whole.status();
  EXPECT_FALSE(StampDifferences(**whole));
}

TEST_F(EurocReader, StatesTheNoiseOfTheImuAndItsPlaceInTheBody) {
  const auto whole = OpenRecording(whole_->path(), {});
  ASSERT_TRUE(whole.ok()) << whole.status();
  ASSERT_TRUE((*whole)->imu_noise());
  EXPECT_EQ((*whole)->imu_noise()->gyro_noise_density,
            rendered_->rig().imu_noise.gyro_noise_density);
  // A body that is turned about z and shifted: the cameras are the same in I.
  const fs::path folder = Copy();
  WriteBytes(folder / "imu0" / "sensor.yaml",
             "T_BS:\n  data: [0.0, -1.0, 0.0, 0.1, 1.0, 0.0, 0.0, 0.2,\n"
             "         0.0, 0.0, 1.0, 0.3, 0.0, 0.0, 0.0, 1.0]\n");
  const auto moved = OpenRecording(copy_.path(), {});
  ASSERT_TRUE(moved.ok()) << moved.status();
  EXPECT_FALSE((*moved)->imu_noise());
  const CameraCalibration& in_I = *(*moved)->cameras()[0].calibration;
  const CameraCalibration& in_B = *(*whole)->cameras()[0].calibration;
  // (1, 2, 3) of I is at (-2, 1, 3) + (0.1, 0.2, 0.3) of B.
  const Eigen::Vector3d a = in_I.q_CI * Eigen::Vector3d(1, 2, 3) + in_I.p_CI;
  const Eigen::Vector3d b =
      in_B.q_CI * Eigen::Vector3d(-1.9, 1.2, 3.3) + in_B.p_CI;
  EXPECT_LT((a - b).norm(), 1e-12);
}

TEST_F(EurocReader, ASecondImuHasReadingsNoiseAndAPose) {
  Rig rig = HandheldRig("two");
  AddSecondImu(&rig);
  const RenderedRecording rendered(rig, MakeHandheld(0.2, 1, 1), {});
  WriteEurocFolder(rendered, rig.factory, copy_.path());
  const auto recording = OpenRecording(copy_.path(), {});
  ASSERT_TRUE(recording.ok()) << recording.status();
  const auto& written = rendered.imu1()->measured;
  ASSERT_EQ((*recording)->imu1().size(), written.size());
  EXPECT_EQ((*recording)->imu1()[3].gyro, written[3].gyro);
  EXPECT_EQ((*recording)->imu1_noise()->accel_noise_density,
            rig.imu1_noise.accel_noise_density);
  const SecondImuCalibration& read = *(*recording)->imu1_calibration();
  EXPECT_LT(read.q_JI.angularDistance(rig.factory.imu1->q_JI), 1e-9);
  EXPECT_LT((read.p_JI - rig.factory.imu1->p_JI).norm(), 1e-9);

  // In a body that is not the first IMU, both move with it.
  const fs::path yaml = copy_.path() / "mav0" / "imu0" / "sensor.yaml";
  WriteBytes(yaml,
             "T_BS:\n  data: [0.0, -1.0, 0.0, 0.1, 1.0, 0.0, 0.0, 0.2,\n"
             "         0.0, 0.0, 1.0, 0.3, 0.0, 0.0, 0.0, 1.0]\n");
  const auto moved = OpenRecording(copy_.path(), {});
  ASSERT_TRUE(moved.ok()) << moved.status();
  const SecondImuCalibration& in_I = *(*moved)->imu1_calibration();
  const Eigen::Vector3d a = in_I.q_JI * Eigen::Vector3d(1, 2, 3) + in_I.p_JI;
  const Eigen::Vector3d b =
      read.q_JI * Eigen::Vector3d(-1.9, 1.2, 3.3) + read.p_JI;
  EXPECT_LT((a - b).norm(), 1e-12);
}

TEST_F(EurocReader, StampsOutOfOrderAreSorted) {
  const std::string first = Stamp(1) + "," + Stamp(1) + ".png\n";
  const std::string second = Stamp(2) + "," + Stamp(2) + ".png\n";
  const auto recording =
      OpenWith("cam0/data.csv", first + second, second + first);
  ASSERT_TRUE(recording.ok()) << recording.status();
  const auto whole = OpenRecording(whole_->path(), {});
  ASSERT_TRUE(whole.ok()) << whole.status();
  EXPECT_EQ((*recording)->cameras()[0].image_times_ns,
            (*whole)->cameras()[0].image_times_ns);
  for (int k = 0; k < 4; ++k) {
    EXPECT_EQ((*recording)->ReadImage(0, k)->pixels,
              (*whole)->ReadImage(0, k)->pixels);
  }
  EXPECT_THAT((*recording)->problems(),
              ElementsAre(copy_.File("mav0/cam0/data.csv") + ": 1 of " +
                          std::to_string(rendered_->images()) +
                          " images are earlier than one before them: sorted "
                          "by time"));
}

TEST_F(EurocReader, SecondImageOfOneTimeIsLeftOut) {
  const auto recording = OpenWith(
      "cam0/data.csv", Stamp(2) + "," + Stamp(2), Stamp(1) + "," + Stamp(2));
  ASSERT_TRUE(recording.ok()) << recording.status();
  const int images = rendered_->images();
  EXPECT_EQ((*recording)->cameras()[0].image_times_ns.size(), images - 1);
  EXPECT_EQ((*recording)->ReadImage(0, 1)->pixels,
            rendered_->Image(0, 1).pixels);
  EXPECT_THAT((*recording)->problems(),
              ElementsAre(copy_.File("mav0/cam0/data.csv") + ": 1 of " +
                          std::to_string(images) +
                          " images have the timestamp of another one: left "
                          "out"));
}

TEST_F(EurocReader, NamesMayLackTheirExtension) {
  const auto recording = OpenWith("cam0/data.csv", Stamp(0) + ".png", Stamp(0));
  ASSERT_TRUE(recording.ok()) << recording.status();
  EXPECT_TRUE((*recording)->problems().empty());
  EXPECT_EQ((*recording)->ReadImage(0, 0)->pixels,
            rendered_->Image(0, 0).pixels);
}

TEST_F(EurocReader, StampThatIsNotInNsIsReported) {
  const auto recording =
      OpenWith("cam0/data.csv", Stamp(1) + ",", "1403715273.26,");
  EXPECT_EQ(recording.status().message(),
            copy_.File("mav0/cam0/data.csv") +
                ": line 3: the timestamp '1403715273.26' is not a number of "
                "ns");
}

TEST_F(EurocReader, MissingImagesAreReportedAndLeftOut) {
  const fs::path camera = Copy() / "cam1";
  const std::size_t images = rendered_->images();
  const fs::path first = camera / "data" / (Stamp(3) + ".png");
  fs::remove(first);
  fs::remove(camera / "data" / (Stamp(4) + ".png"));
  const auto recording = OpenRecording(copy_.path(), {});
  ASSERT_TRUE(recording.ok()) << recording.status();
  ASSERT_EQ((*recording)->problems().size(), 1u);
  EXPECT_EQ((*recording)->problems()[0],
            copy_.File("mav0/cam1/data.csv") + ": 2 of " +
                std::to_string(images) + " images are missing, " +
                first.string() + " first");
  EXPECT_EQ((*recording)->cameras()[0].image_times_ns.size(), images);
  EXPECT_EQ((*recording)->cameras()[1].image_times_ns.size(), images - 2);
  fs::remove_all(camera / "data");
  EXPECT_EQ(OpenRecording(copy_.path(), {}).status().code(),
            absl::StatusCode::kNotFound);
}

TEST_F(EurocReader, MissingListsAreReported) {
  const fs::path mav = Copy();
  fs::remove(mav / "imu0" / "data.csv");
  auto recording = OpenRecording(copy_.path(), {});
  EXPECT_EQ(recording.status().code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(recording.status().message(),
            copy_.File("mav0/imu0/data.csv") + ": cannot be opened");
  fs::remove_all(mav / "cam0");
  recording = OpenRecording(copy_.path(), {});
  EXPECT_EQ(recording.status().message(),
            mav.string() + ": there is no folder cam0");
  EXPECT_FALSE(OpenRecording(copy_.File("nowhere"), {}).ok());
}

TEST_F(EurocReader, LineThatIsCutOffIsReported) {
  const fs::path path = Copy() / "imu0" / "data.csv";
  WriteBytes(path, "#timestamp\n1000,1,2,3,4,5,6\r\n2000,1,2,3,4,5\n");
  EXPECT_EQ(OpenRecording(copy_.path(), {}).status().message(),
            path.string() + ": line 3: 6 values instead of 7");
  WriteBytes(path, "1000,1,2,3,4,5,6\n2000,1,2,3,nan,5,6\n");
  EXPECT_EQ(OpenRecording(copy_.path(), {}).status().message(),
            path.string() +
                ": line 2: the reading 'nan' is not a finite "
                "number");
  WriteBytes(path, "#timestamp\n");
  EXPECT_EQ(OpenRecording(copy_.path(), {}).status().message(),
            path.string() + ": lists nothing");
}

TEST_F(EurocReader, ImageOfAnotherSizeIsReported) {
  const fs::path path = Copy() / "cam0" / "data" / (Stamp(0) + ".png");
  ASSERT_TRUE(cv::imwrite(path, cv::Mat(240, 320, CV_8UC1, cv::Scalar(1))));
  const auto recording = OpenRecording(copy_.path(), {});
  ASSERT_TRUE(recording.ok()) << recording.status();
  const auto pixels = (*recording)->ReadImage(0, 0);
  EXPECT_EQ(pixels.status().code(), absl::StatusCode::kDataLoss);
  EXPECT_EQ(pixels.status().message(),
            path.string() + ": 320 x 240 px instead of the 752 x 480 of cam0");
}

TEST_F(EurocReader, ImageThatIsRemovedOrCutLaterIsReported) {
  const fs::path path = Copy() / "cam0" / "data" / (Stamp(0) + ".png");
  const auto recording = OpenRecording(copy_.path(), {});
  ASSERT_TRUE(recording.ok()) << recording.status();
  WriteBytes(path, ReadBytes(path).substr(0, 1000));
  EXPECT_EQ((*recording)->ReadImage(0, 0).status().message(),
            path.string() + ": not a whole PNG: Read Error");
  fs::remove(path);
  EXPECT_EQ((*recording)->ReadImage(0, 0).status().message(),
            path.string() + ": cannot be opened");
}

TEST_F(EurocReader, BrokenSensorYamlIsReportedAndAMissingOneIsNot) {
  auto recording = OpenWith("cam0/sensor.yaml", "resolution", "size");
  EXPECT_EQ(recording.status().message(),
            copy_.File("mav0/cam0/sensor.yaml") +
                ": resolution is not a list of numbers");
  fs::remove(copy_.path() / "mav0" / "cam0" / "sensor.yaml");
  recording = OpenRecording(copy_.path(), {});
  ASSERT_TRUE(recording.ok()) << recording.status();
  EXPECT_FALSE((*recording)->cameras()[0].calibration);
  EXPECT_TRUE((*recording)->problems().empty());
}

TEST_F(EurocReader, TracksOfFilesAreThoseOfTheirImages) {
  const auto recording = OpenRecording(whole_->path(), {});
  ASSERT_TRUE(recording.ok()) << recording.status();
  const Calibration& theta = rendered_->rig().factory;
  const std::vector<TrackPoint> points = TrackAll(**recording, theta);
  FeatureTracker tracker(theta, {});
  for (ImuSample sample : rendered_->imu().measured) {
    sample.t_ns += kEurocEpoch_ns;
    tracker.AddImu(sample);
  }
  std::size_t i = 0;
  for (int k = 0; k < rendered_->images(); ++k) {
    GreyImage left = rendered_->Image(0, k);
    GreyImage right = rendered_->Image(1, k);
    const std::vector<cv::Mat> images = {
        {left.height_px, left.width_px, CV_8UC1, left.pixels.data()},
        {right.height_px, right.width_px, CV_8UC1, right.pixels.data()}};
    for (const TrackPoint& point :
         tracker.Track(kEurocEpoch_ns + rendered_->stamp_ns(k), images)) {
      ASSERT_LT(i, points.size());
      EXPECT_EQ(points[i].landmark, point.landmark);
      EXPECT_EQ(points[i].z_px, point.z_px);
      ++i;
    }
  }
  EXPECT_EQ(i, points.size());
}

TEST(EurocImages, RealImagesAreTracked) {
  SELFCAL_NEED_RECORDING(folder, "euroc_images");
  const auto recording = OpenRecording(folder, {});
  ASSERT_TRUE(recording.ok()) << recording.status();
  ASSERT_EQ((*recording)->cameras().size(), 2u);
  Calibration theta;
  for (const RecordedCamera& camera : (*recording)->cameras()) {
    ASSERT_TRUE(camera.calibration);
    EXPECT_TRUE(camera.has_pose);
    theta.cameras.push_back(*camera.calibration);
  }
  const std::vector<TrackPoint> points = TrackAll(**recording, theta);
  std::set<std::pair<int, std::uint64_t>> tracks;
  std::set<std::pair<int, std::uint64_t>> left;
  std::size_t stereo = 0;
  for (const TrackPoint& point : points) {
    tracks.emplace(point.camera, point.landmark);
    if (point.camera == 0) left.emplace(point.image, point.landmark);
  }
  for (const TrackPoint& point : points) {
    if (point.camera == 1)
      stereo += left.contains({point.image, point.landmark});
  }
  const std::size_t images = (*recording)->cameras()[0].image_times_ns.size();
  const double per_image = static_cast<double>(points.size()) / (2 * images);
  const double length = static_cast<double>(points.size()) / tracks.size();
  RecordProperty("points_per_image", std::to_string(per_image));
  RecordProperty("track_length", std::to_string(length));
  RecordProperty("stereo_per_image", std::to_string(stereo / images));
  EXPECT_GT(per_image, 150);
  EXPECT_GT(length, 40);
  EXPECT_GT(stereo / images, 100u);
}

}  // namespace
}  // namespace selfcal::client
