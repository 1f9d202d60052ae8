#include "core/population/device.h"

#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "core/information/fusion.h"
#include "core/simulation/simulate.h"
#include "test/core/population/run_estimate.h"

namespace selfcal {
namespace {

// Small enough that the curvature of rotations does not matter.
constexpr double kFar = 1e-6;

class DeviceInformationTest : public testing::Test {
 protected:
  Eigen::VectorXd Normals(Eigen::Index count) {
    return Eigen::VectorXd::NullaryExpr(
        count, [&] { return std::normal_distribution()(random_); });
  }

  // Of a segment that observes `rows` directions of the free components.
  SegmentInformation Segment(const Rig& rig, int rows) {
    const Eigen::VectorXd scale = PriorSigmas(rig);
    SegmentInformation segment;
    segment.theta0 =
        BoxPlus(rig.factory, kFar * scale.cwiseProduct(Normals(scale.size())));
    const std::vector<int> free = FreeComponents(rig);
    Eigen::MatrixXd J = Eigen::MatrixXd::Zero(rows, scale.size());
    for (int i = 0; i < rows; ++i) {
      for (const int k : free) J(i, k) = 10 * Normals(1)(0) / scale(k);
    }
    segment.Lambda = J.transpose() * J;
    segment.eta = J.transpose() * (kFar * Normals(rows));
    return segment;
  }

  std::mt19937 random_{1};
};

TEST_F(DeviceInformationTest, IsThatOfTheData) {
  const Rig rig = HandheldRig("device");
  const Eigen::VectorXd scale = PriorSigmas(rig);
  for (const int rows : {3, 60}) {
    const SegmentInformation data = Segment(rig, rows);
    const RunEstimate run = EstimateAsARun(rig, data);
    const Calibration reference =
        BoxPlus(rig.factory, kFar * scale.cwiseProduct(Normals(scale.size())));
    const ThetaInformation found =
        DeviceInformation(rig, run.theta, run.covariance, reference);
    const ThetaInformation expected = Transport(data, reference);
    const auto normalised = [&](const Eigen::MatrixXd& Lambda) {
      return Eigen::MatrixXd(scale.asDiagonal() * Lambda * scale.asDiagonal());
    };
    EXPECT_LT((normalised(found.Lambda) - normalised(expected.Lambda)).norm(),
              1e-6 * normalised(expected.Lambda).norm())
        << rows;
    EXPECT_LT(scale.cwiseProduct(found.eta - expected.eta).norm(),
              1e-3 * scale.cwiseProduct(expected.eta).norm())
        << rows;
  }
}

TEST_F(DeviceInformationTest, OfACalibrationWithoutDataIsNone) {
  const Rig rig = HandheldRig("device");
  SegmentInformation nothing = Segment(rig, 1);
  nothing.Lambda.setZero();
  nothing.eta.setZero();
  const RunEstimate run = EstimateAsARun(rig, nothing);
  for (const double widened : {1.0, 1.2}) {
    const ThetaInformation found = DeviceInformation(
        rig, run.theta, widened * run.covariance, rig.factory);
    EXPECT_EQ(found.Lambda.norm(), 0) << widened;
    EXPECT_EQ(found.eta.norm(), 0) << widened;
  }
}

}  // namespace
}  // namespace selfcal
