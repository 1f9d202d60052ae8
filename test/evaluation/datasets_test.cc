#include "test/evaluation/datasets.h"

#include <gtest/gtest.h>

#include <set>
#include <string>

namespace selfcal {
namespace {

constexpr double kShort_s = 9;

TEST(Datasets, KeepTheRulesOfSegmentsAndAreReproducible) {
  std::set<std::string> names;
  for (int i = 0; i < kDatasets; ++i) {
    const Dataset dataset = MakeDataset(i, kShort_s);
    names.insert(dataset.name);
    ASSERT_EQ(dataset.segments().size(), 2u) << dataset.name;
    for (const MotionSegment& segment : dataset.segments()) {
      EXPECT_EQ(segment.keyframes.size(), 40u);
      EXPECT_TRUE(Validate(segment, dataset.rig.factory).empty())
          << dataset.name;
    }
    const Dataset again = MakeDataset(i, kShort_s);
    EXPECT_EQ(dataset.segments()[1].keyframes[7].p_GI,
              again.segments()[1].keyframes[7].p_GI);
  }
  EXPECT_EQ(names.size(), static_cast<std::size_t>(kDatasets));
}

TEST(Datasets, ShareOneDeviceWithAWrongFactory) {
  const EvaluatedDevice device = MakeDevice();
  EXPECT_GT(BoxMinus(device.rig.factory, device.truth).norm(), 1);
  EXPECT_TRUE(Validate(device.rig).empty());
  for (const int i : {0, kDatasets - 1}) {
    EXPECT_EQ(BoxMinus(MakeDataset(i, kShort_s).truth, device.truth).norm(), 0);
  }
}

TEST(Datasets, LastThreeMinutesUnlessARecordingIsShorter) {
  for (int i = 0; i < kDatasets; ++i) {
    const Motion motion = MakeMotion(i);
    const double duration_s = motion.trajectory->duration_s();
    if (motion.recorded) {
      EXPECT_LE(duration_s, kDatasetDuration_s) << motion.name;
      EXPECT_GE(duration_s, 80) << motion.name;
    } else {
      EXPECT_EQ(duration_s, kDatasetDuration_s) << motion.name;
    }
  }
}

}  // namespace
}  // namespace selfcal
