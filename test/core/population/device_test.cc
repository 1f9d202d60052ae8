#include "core/population/device.h"

#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "core/information/fusion.h"
#include "core/simulation/simulate.h"

namespace selfcal {
namespace {

// Small enough that the curvature of rotations does not matter.
constexpr double kFar = 1e-3;

class DeviceInformationTest : public testing::Test {
 protected:
  Eigen::VectorXd Normals(Eigen::Index count) {
    return Eigen::VectorXd::NullaryExpr(
        count, [&] { return std::normal_distribution()(random_); });
  }

  // Of a segment that observes `rows` directions.
  SegmentInformation Segment(const Rig& rig, int rows) {
    const Eigen::VectorXd scale = PriorSigmas(rig);
    SegmentInformation segment;
    segment.theta0 =
        BoxPlus(rig.factory, kFar * scale.cwiseProduct(Normals(scale.size())));
    Eigen::MatrixXd J(rows, scale.size());
    for (int i = 0; i < rows; ++i) {
      J.row(i) = 10 * Normals(scale.size()).cwiseQuotient(scale).transpose();
    }
    segment.Lambda = J.transpose() * J;
    segment.eta = J.transpose() * (kFar * Normals(rows));
    return segment;
  }

  std::mt19937 random_{1};
};

TEST_F(DeviceInformationTest, IsWhatTheDataAddedToThePrior) {
  const Rig rig = HandheldRig("device");
  for (const int rows : {3, 60}) {
    const SegmentInformation data = Segment(rig, rows);
    const FusedEstimate fused = Fuse(rig, std::vector{data});
    const Calibration reference = BoxPlus(
        rig.factory,
        kFar * PriorSigmas(rig).cwiseProduct(Normals(PriorSigmas(rig).size())));
    const ThetaInformation found =
        DeviceInformation(rig, fused.theta, fused.covariance, reference);
    const ThetaInformation expected = Transport(data, reference);
    const Eigen::VectorXd scale = PriorSigmas(rig);
    const std::vector<int> free = FreeComponents(rig);
    const auto normalised = [&](const ThetaInformation& of) {
      return Eigen::MatrixXd(
          (scale.asDiagonal() * of.Lambda * scale.asDiagonal())(free, free));
    };
    EXPECT_LT((normalised(found) - normalised(expected)).norm(),
              1e-6 * normalised(expected).norm())
        << rows;
    // The estimate that it states is that of the data with the prior.
    Eigen::MatrixXd posterior = normalised(found);
    posterior.diagonal().array() += 1;
    const Eigen::VectorXd prior_eta =
        BoxMinus(rig.factory, reference)(free).cwiseQuotient(
            Eigen::VectorXd(scale(free)));
    const Eigen::VectorXd offset = posterior.llt().solve(
        Eigen::VectorXd(scale.cwiseProduct(found.eta)(free)) + prior_eta);
    const Eigen::VectorXd expected_offset =
        BoxMinus(fused.theta, reference)(free).cwiseQuotient(
            Eigen::VectorXd(scale(free)));
    EXPECT_LT((offset - expected_offset).norm(), 1e-3 * kFar) << rows;
  }
}

TEST_F(DeviceInformationTest, OfACalibrationWithoutDataIsNone) {
  const Rig rig = HandheldRig("device");
  const FusedEstimate fused = Fuse(rig, {});
  const ThetaInformation found =
      DeviceInformation(rig, fused.theta, 1.2 * fused.covariance, rig.factory);
  EXPECT_EQ(found.Lambda.norm(), 0);
  EXPECT_EQ(found.eta.norm(), 0);
}

}  // namespace
}  // namespace selfcal
