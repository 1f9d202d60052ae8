#include "client/recording/track_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "client/recording/recording.h"
#include "test/support/files.h"
#include "test/support/temp_folder.h"

namespace selfcal::client {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

class TrackFolder : public testing::Test {
 protected:
  TrackFolder() {
    Write("tracks.csv",
          "time,camera,landmark,x,y\n"
          "2000,0,7,10.5,-0.25\n"
          "1000,0,9,3,4\n"
          "1000,1,7,5,6\n"
          "1000,0,7,1,2\n");
    Write("imu.csv", "500,1,2,3,4,5,6\n2500,1,2,3,4,5,6\n");
  }
  void Write(const std::string& name, const std::string& text) {
    WriteBytes(folder_.File(name), text);
  }
  std::string Error() {
    return std::string(OpenRecording(folder_.path(), {}).status().message());
  }

  TempFolder folder_;
};

TEST_F(TrackFolder, HasThePointsOfEachImage) {
  const auto recording = OpenRecording(folder_.path(), {});
  ASSERT_TRUE(recording.ok()) << recording.status();
  ASSERT_EQ((*recording)->cameras().size(), 2u);
  EXPECT_EQ((*recording)->cameras()[1].name, "cam1");
  EXPECT_THAT((*recording)->cameras()[0].image_times_ns,
              ElementsAre(1000, 2000));
  EXPECT_THAT((*recording)->cameras()[1].image_times_ns, ElementsAre(1000));
  EXPECT_EQ((*recording)->imu().size(), 2u);
  EXPECT_TRUE((*recording)->problems().empty());
  const std::vector<RecordedPoint>& first = *(*recording)->Points(0, 0);
  ASSERT_EQ(first.size(), 2u);
  EXPECT_EQ(first[0].landmark, 7u);
  EXPECT_EQ(first[0].z_px, Eigen::Vector2d(1, 2));
  EXPECT_EQ(first[1].landmark, 9u);
  const std::vector<RecordedPoint>& second = *(*recording)->Points(0, 1);
  ASSERT_EQ(second.size(), 1u);
  EXPECT_EQ(second[0].z_px, Eigen::Vector2d(10.5, -0.25));
  EXPECT_THAT(std::string((*recording)->ReadImage(0, 0).status().message()),
              HasSubstr("has tracks and no images: state the calibration"));
}

TEST_F(TrackFolder, APointThatIsListedAgainIsLeftOut) {
  Write("tracks.csv", "1000,0,7,1,2\n1000,0,8,1,2\n1000,0,7,3,4\n");
  const auto recording = OpenRecording(folder_.path(), {});
  ASSERT_TRUE(recording.ok()) << recording.status();
  EXPECT_EQ((*recording)->Points(0, 0)->size(), 2u);
  EXPECT_EQ((*recording)->Points(0, 0)->front().z_px, Eigen::Vector2d(1, 2));
  EXPECT_THAT((*recording)->problems(),
              ElementsAre(folder_.File("tracks.csv") +
                          ": 1 of 3 points are listed again for the same "
                          "image: left out"));
}

TEST_F(TrackFolder, WhatIsWrongIsNamedWithItsLine) {
  const std::string list = folder_.File("tracks.csv");
  const std::string wrong[][2] = {
      {"1000,0,7,1\n", ": line 1: 4 values instead of 5"},
      {"1000,16,7,1,2\n",
       ": line 1: the camera '16' is not a number from 0 to 15"},
      {"1000,-1,7,1,2\n",
       ": line 1: the camera '-1' is not a number from 0 to 15"},
      {"1000,0,-7,1,2\n", ": line 1: the landmark '-7' is not a whole number"},
      {"1000,0,7,1,nan\n", ": line 1: the pixel 'nan' is not a finite number"},
      {"1000,1,7,1,2\n", ": camera 0 has no points; number the cameras from 0"},
      {"", ": lists nothing"}};
  for (const auto& [text, message] : wrong) {
    Write("tracks.csv", text);
    EXPECT_EQ(Error(), list + message);
  }
}

}  // namespace
}  // namespace selfcal::client
