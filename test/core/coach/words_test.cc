#include "core/coach/words.h"

#include <gtest/gtest.h>

#include <set>
#include <string>

#include "test/core/simulation/rigs.h"

namespace selfcal {
namespace {

TEST(Words, EveryComponentHasItsOwn) {
  Rig rig = RigOfCameras(4);
  EstimateEveryBlock(&rig);
  std::set<std::string> all;
  const auto components = TangentComponents(rig.factory);
  for (const TangentComponent& component : components) {
    const std::string words = ComponentInWords(component.name);
    EXPECT_NE(words, component.name);
    EXPECT_TRUE(words.starts_with("the ")) << words;
    // Only technical names have one.
    EXPECT_EQ(words.find('_'), std::string::npos) << words;
    all.insert(words);
  }
  EXPECT_EQ(all.size(), components.size());
}

TEST(Words, NameSensorAndAxis) {
  EXPECT_EQ(ComponentInWords("imu.accel.scale.z"),
            "the accelerometer's scale on z");
  EXPECT_EQ(ComponentInWords("cam1.p_CI.x"),
            "the distance from the IMU along x of camera 1");
}

TEST(Words, KeepAnUnknownName) {
  for (const std::string name :
       {"", ".", "imu", "imu.", "imu.magnet.x", "cam0.colour", "lidar.x"}) {
    EXPECT_EQ(ComponentInWords(name), name);
  }
}

TEST(Words, OfADirectionNameItsLargestParts) {
  UnobservedDirection direction;
  direction.parts = {{"imu.gyro.scale.x", 0.9}};
  EXPECT_EQ(DirectionInWords(direction), "the gyroscope's scale on x");
  direction.parts.push_back({"cam0.focal.x", -0.3});
  EXPECT_EQ(DirectionInWords(direction),
            "a combination of the gyroscope's scale on x and the focal length "
            "in x of "
            "camera 0");
  direction.parts.push_back({"imu.gyro.scale.y", 0.2});
  direction.parts.push_back({"imu.gyro.scale.z", 0.2});
  EXPECT_EQ(
      DirectionInWords(direction),
      "a combination of the gyroscope's scale on x, the focal length in x of "
      "camera 0, the gyroscope's scale on y and others");
}

}  // namespace
}  // namespace selfcal
