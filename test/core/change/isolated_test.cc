#include "core/change/isolated.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <vector>

#include "test/core/change/random_information.h"

namespace selfcal {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

class IsolatedTest : public ::testing::Test {
 protected:
  // The next segment of a device that is so many reference sigmas from the
  // factory's calibration, in a direction that is drawn for `device`.
  void Next(double sigmas, int device = 0) {
    while (static_cast<int>(directions_.size()) <= device) {
      directions_.push_back(random_.Direction(rig_));
    }
    segments_.push_back(tester_.Offset(
        random_.Segment(rig_, rig_.factory, sigmas * directions_[device])));
  }

  const Rig rig_ = HandheldRig("a");
  RandomInformation random_{7};
  const ConsistencyTester tester_{rig_, FactoryKnownTo(rig_, 0.04)};
  std::vector<Eigen::VectorXd> directions_;
  std::vector<OffsetInformation> segments_;
};

TEST_F(IsolatedTest, NoneIsAmongSegmentsOfOneDevice) {
  for (int i = 0; i < 40; ++i) Next(0);
  EXPECT_THAT(FindIsolated(segments_), IsEmpty());
}

TEST_F(IsolatedTest, SegmentsOfOtherDevicesAre) {
  for (int i = 0; i < 21; ++i) Next(i % 5 == 3 ? 40 : 0, i);
  EXPECT_THAT(FindIsolated(segments_), ElementsAre(3, 8, 13, 18));
}

TEST_F(IsolatedTest, TheNewestIsUntilTheNextAgreesWithIt) {
  for (int i = 0; i < 10; ++i) Next(0);
  Next(40);
  EXPECT_THAT(FindIsolated(segments_), ElementsAre(10));
  Next(40);
  EXPECT_THAT(FindIsolated(segments_), IsEmpty());
}

TEST_F(IsolatedTest, NoneIsIfAllAreOverconfident) {
  for (int i = 0; i < 20; ++i) {
    Next(0);
    segments_.back().Lambda *= 9;
    segments_.back().eta *= 9;
  }
  EXPECT_THAT(FindIsolated(segments_), IsEmpty());
}

}  // namespace
}  // namespace selfcal
