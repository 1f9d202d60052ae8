#include "client/recording/csv_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "client/recording/recording.h"
#include "test/support/files.h"
#include "test/support/temp_folder.h"

namespace selfcal::client {
namespace {

using testing::ElementsAre;

class CsvFolder : public testing::Test {
 protected:
  CsvFolder() {
    Write("a.png", "");
    Write("b.png", "");
    Write("cam0.csv", "time,file\n1000, a.png\n2000, b\r\n");
    Write("imu.csv",
          "# gyro, accel\n\n500,1,2,3,4,5,6\n1500,1e-3,0,0,-1,0,9\n");
  }
  void Write(const std::string& name, const std::string& text) {
    WriteBytes(folder_.File(name), text);
  }
  std::string Error() {
    return std::string(OpenRecording(folder_.path(), {}).status().message());
  }

  TempFolder folder_;
};

TEST_F(CsvFolder, HasHeadingsCommentsAndNamesWithoutExtension) {
  const auto recording = OpenRecording(folder_.path(), {});
  ASSERT_TRUE(recording.ok()) << recording.status();
  ASSERT_EQ((*recording)->cameras().size(), 1u);
  EXPECT_THAT((*recording)->cameras()[0].image_times_ns,
              ElementsAre(1000, 2000));
  ASSERT_EQ((*recording)->imu().size(), 2u);
  EXPECT_EQ((*recording)->imu()[1].t_ns, 1500);
  EXPECT_EQ((*recording)->imu()[1].gyro, Eigen::Vector3d(1e-3, 0, 0));
  EXPECT_EQ((*recording)->imu()[1].accel, Eigen::Vector3d(-1, 0, 9));
  EXPECT_EQ((*recording)->ReadImage(0, 0).status().message(),
            folder_.File("a.png") + ": neither a PNG nor a JPEG");
}

TEST_F(CsvFolder, ASecondImuHasAListOfItsOwn) {
  const auto one = OpenRecording(folder_.path(), {});
  ASSERT_TRUE(one.ok()) << one.status();
  EXPECT_TRUE((*one)->imu1().empty());
  Write("imu1.csv", "700,1,2,3,4,5,7\n600,1,2,3,4,5,6\n");
  const auto two = OpenRecording(folder_.path(), {});
  ASSERT_TRUE(two.ok()) << two.status();
  ASSERT_EQ((*two)->imu1().size(), 2u);
  EXPECT_EQ((*two)->imu1()[0].t_ns, 600);
  EXPECT_EQ((*two)->imu1()[1].accel.z(), 7);
  EXPECT_EQ((*two)->problems().size(), 1u);
  (*two)->ShiftReadings(50);
  EXPECT_EQ((*two)->imu1()[0].t_ns, 650);
  EXPECT_EQ((*two)->imu()[0].t_ns, 550);
  Write("imu1.csv", "x");
  EXPECT_EQ(Error().substr(0, folder_.File("imu1.csv").size()),
            folder_.File("imu1.csv"));
}

TEST_F(CsvFolder, FurtherCamerasAreNumbered) {
  Write("cam1.csv", "1000,a.png\n");
  Write("cam3.csv", "1000,a.png\n");
  const auto recording = OpenRecording(folder_.path(), {});
  ASSERT_TRUE(recording.ok()) << recording.status();
  ASSERT_EQ((*recording)->cameras().size(), 2u);
  EXPECT_EQ((*recording)->cameras()[1].name, "cam1");
}

TEST_F(CsvFolder, WhatIsWrongIsNamedWithItsLine) {
  const std::string images = folder_.File("cam0.csv");
  Write("cam0.csv", "1000,a.png\n2000\n");
  EXPECT_EQ(Error(), images + ": line 2: 1 values instead of 2");
  Write("cam0.csv", "1000,a.png\n2000,\n");
  EXPECT_EQ(Error(), images + ": line 2: has no file name");
  Write("cam0.csv", "time,file\ntime,file\n");
  EXPECT_EQ(Error(),
            images + ": line 2: the timestamp 'time' is not a number of ns");
  Write("cam0.csv", std::string(5000, '1'));
  EXPECT_EQ(Error(), images + ": line 1: longer than 4095 characters");
  Write("cam0.csv", "1000,c.png\n");
  EXPECT_EQ(Error(),
            images + ": 1 of 1 images are missing, " + folder_.File("c.png") +
                " first");
  Write("cam0.csv", "");
  EXPECT_EQ(Error(), images + ": lists nothing");
}

TEST_F(CsvFolder, ReadingsMustBeThere) {
  std::filesystem::remove(folder_.File("imu.csv"));
  EXPECT_EQ(Error(), folder_.File("imu.csv") + ": cannot be opened");
}

}  // namespace
}  // namespace selfcal::client
