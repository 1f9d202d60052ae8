#include "core/change/heterogeneity.h"

#include <gtest/gtest.h>

#include <vector>

#include "test/core/change/random_information.h"

namespace selfcal {
namespace {

class HeterogeneityTest : public ::testing::Test {
 protected:
  OffsetInformation Segment() {
    const Eigen::VectorXd zero =
        Eigen::VectorXd::Zero(TangentSize(rig_.factory));
    return tester_.Offset(random_.Segment(rig_, rig_.factory, zero));
  }

  const Rig rig_ = HandheldRig("a");
  RandomInformation random_{19};
  const ConsistencyTester tester_{rig_, FactoryKnownTo(rig_, 0.3)};
};

TEST_F(HeterogeneityTest, IsTheOverconfidenceOfSegments) {
  std::vector<OffsetInformation> segments;
  for (int i = 0; i < 20; ++i) segments.push_back(Segment());
  const Eigen::MatrixXd& all = tester_.parts().front().basis;
  const auto heterogeneity = [&] {
    const Course course =
        MakeCourse(segments, StepCourse(20, 20), tester_.root());
    return Heterogeneity(segments).Of(StepCourse(20, 20), course, all);
  };
  EXPECT_LT(heterogeneity(), 1.2);
  for (OffsetInformation& segment : segments) {
    segment.Lambda *= 9;
    segment.eta *= 9;
  }
  EXPECT_NEAR(heterogeneity(), 9, 2);
}

}  // namespace
}  // namespace selfcal
