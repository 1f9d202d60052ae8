#include "core/change/course.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "test/core/change/random_information.h"

namespace selfcal {
namespace {

class CourseTest : public ::testing::Test {
 protected:
  OffsetInformation Segment(const Calibration& theta0) {
    const Eigen::VectorXd zero =
        Eigen::VectorXd::Zero(TangentSize(rig_.factory));
    return tester_.Offset(random_.Segment(rig_, theta0, zero));
  }

  const Rig rig_ = HandheldRig("a");
  RandomInformation random_{11};
  const ConsistencyTester tester_{rig_, FactoryKnownTo(rig_, 0.3)};
};

// The definition: all segments as one normal vector with its covariance.
OffsetInformation LeastSquares(const std::vector<OffsetInformation>& segments,
                               const Eigen::VectorXd& weights,
                               const Eigen::MatrixXd& Sigma) {
  const Eigen::Index size = Sigma.rows();
  const auto count = static_cast<Eigen::Index>(segments.size());
  Eigen::MatrixXd C = Eigen::MatrixXd::Zero(count * size, count * size);
  Eigen::MatrixXd design(count * size, size);
  Eigen::VectorXd eta(count * size);
  for (Eigen::Index i = 0; i < count; ++i) {
    design.middleRows(i * size, size) = weights(i) * segments[i].Lambda;
    eta.segment(i * size, size) = segments[i].eta;
    for (Eigen::Index j = 0; j < count; ++j) {
      Eigen::MatrixXd error = Sigma;
      if (segments[i].reach.size() > 0 && segments[j].reach.size() > 0) {
        error.diagonal() +=
            (1 + weights(i) * weights(j)) * segments[i].reach.cwiseAbs2();
      }
      C.block(i * size, j * size, size, size) =
          segments[i].Lambda * error * segments[j].Lambda;
    }
    C.block(i * size, i * size, size, size) += segments[i].Lambda;
  }
  const Eigen::LDLT<Eigen::MatrixXd> ldlt(C);
  return {design.transpose() * ldlt.solve(design),
          design.transpose() * ldlt.solve(eta)};
}

TEST_F(CourseTest, IsTheLeastSquaresOfAllSegmentsTogether) {
  const Calibration elsewhere =
      BoxPlus(rig_.factory, 0.05 * random_.Direction(rig_));
  std::vector<OffsetInformation> segments;
  for (int i = 0; i < 5; ++i) {
    segments.push_back(Segment(i == 1 || i == 3 ? elsewhere : rig_.factory));
  }
  const Eigen::VectorXd weights = RampCourse(5, 4);
  const OffsetInformation expected = LeastSquares(
      segments, weights, tester_.root() * tester_.root().transpose());
  Course course = MakeCourse(segments, weights, tester_.root());
  const OffsetInformation change = course.Change();
  EXPECT_LT((change.Lambda - expected.Lambda).norm(),
            1e-6 * expected.Lambda.norm());
  EXPECT_LT((change.eta - expected.eta).norm(), 1e-6 * expected.eta.norm());
  // A segment that is removed was never there.
  const OffsetInformation other = Segment(elsewhere);
  course.Add(other, 0.3);
  course.Remove(other, 0.3);
  EXPECT_LT((course.Change().eta - change.eta).norm(),
            1e-9 * change.eta.norm());
}

TEST_F(CourseTest, WeightsAreThoseOfTheNewest) {
  EXPECT_EQ(StepCourse(4, 2), Eigen::Vector4d(0, 0, 1, 1));
  EXPECT_EQ(RampCourse(4, 2), Eigen::Vector4d(0, 0, 0.5, 1));
}

TEST_F(CourseTest, EveryBlockIsChiSquareDistributedWithoutAChange) {
  constexpr int kTrials = 600;
  const KnownCalibration active = FactoryKnownTo(rig_, 0.3);
  const auto& parts = tester_.parts();
  std::vector<double> statistic(parts.size());
  std::vector<int> rare(parts.size());
  for (int trial = 0; trial < kTrials; ++trial) {
    const Eigen::VectorXd error = random_.Noise(active.covariance);
    std::vector<OffsetInformation> segments;
    for (int i = 0; i < 6; ++i) {
      segments.push_back(
          tester_.Offset(random_.Segment(rig_, rig_.factory, error, 0.5)));
    }
    const OffsetInformation change =
        MakeCourse(segments, RampCourse(6, 4), tester_.root()).Change();
    for (std::size_t b = 0; b < parts.size(); ++b) {
      const ConsistencyTest test = TestSpan(change, parts[b].basis);
      ASSERT_EQ(test.degrees, parts[b].basis.cols());
      statistic[b] += test.statistic / test.degrees;
      rare[b] += test.probability < 0.05;
    }
  }
  for (std::size_t b = 0; b < parts.size(); ++b) {
    const auto degrees = static_cast<double>(parts[b].basis.cols());
    // Four standard deviations.
    EXPECT_NEAR(
        statistic[b] / kTrials, 1, 4 * std::sqrt(2 / (degrees * kTrials)))
        << parts[b].name;
    EXPECT_NEAR(rare[b], 0.05 * kTrials, 4 * std::sqrt(0.05 * 0.95 * kTrials))
        << parts[b].name;
  }
}

}  // namespace
}  // namespace selfcal
