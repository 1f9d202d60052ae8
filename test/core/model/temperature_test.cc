#include "core/model/temperature.h"

#include <gtest/gtest.h>

#include <string>

#include "core/model/parameter_blocks.h"
#include "core/model/rig.h"
#include "core/model/so3.h"
#include "test/core/model/random_values.h"

namespace selfcal {
namespace {

// Random slopes of all blocks that may have one.
Calibration WithAllSlopes(RandomValues* random, Calibration theta) {
  const auto fill = [&](auto* sensor) {
    const auto fill_block = [&]<class Value>(const BlockInfo& info,
                                             Value& value) {
      if constexpr (std::is_same_v<Value, OptionalVector>) {
        if (info.name.ends_with(kSlopeSuffix)) {
          value = random->Vector(OptionalSizes(info, *sensor)[0], 5e-3);
        }
      }
    };
    VisitWithSlopes(fill_block, *sensor);
  };
  fill(&theta.imu);
  for (CameraCalibration& camera : theta.cameras) fill(&camera);
  theta.reference_temperature_c = random->Uniform(-20, 60);
  return theta;
}

TEST(Temperature, AtTheReferenceOnlyTheSlopesAreGone) {
  RandomValues random(1);
  const Calibration plain = random.Theta();
  const Calibration theta = WithAllSlopes(&random, plain);
  const Calibration at = AtTemperature(theta, theta.reference_temperature_c);
  EXPECT_TRUE(HasSlopes(theta));
  EXPECT_FALSE(HasSlopes(at));
  ASSERT_TRUE(SameShape(at, plain));
  EXPECT_LT(BoxMinus(at, plain).norm(), 1e-14);
  int coefficients = 0;
  for (const CameraCalibration& camera : theta.cameras) {
    coefficients += static_cast<int>(camera.distortion.size());
  }
  EXPECT_EQ(TangentSize(theta),
            TangentSize(plain) + 15 + 3 * 11 + coefficients);
}

TEST(Temperature, ValuesFollowTheSlopes) {
  RandomValues random(2);
  const Calibration theta = WithAllSlopes(&random, random.Theta());
  const Calibration at =
      AtTemperature(theta, theta.reference_temperature_c + 12);
  EXPECT_LT((at.imu.s_g - theta.imu.s_g - 12 * theta.imu.s_g_slope).norm(),
            1e-14);
  EXPECT_LT(
      (at.cameras[1].f - theta.cameras[1].f - 12 * theta.cameras[1].f_slope)
          .norm(),
      1e-11);
  EXPECT_LT((at.cameras[1].distortion - theta.cameras[1].distortion -
             12 * theta.cameras[1].distortion_slope)
                .norm(),
            1e-14);
  EXPECT_NEAR(at.cameras[2].time_offset_s,
              theta.cameras[2].time_offset_s +
                  12 * theta.cameras[2].time_offset_slope[0],
              1e-15);
  EXPECT_LT((Log(theta.cameras[2].q_CI.conjugate() * at.cameras[2].q_CI) -
             12 * theta.cameras[2].q_CI_slope)
                .norm(),
            1e-14);
}

TEST(Temperature, DerivativeIsThatOfTheSeenTangent) {
  RandomValues random(3);
  for (int trial = 0; trial < 200; ++trial) {
    const Calibration theta = WithAllSlopes(&random, random.Theta());
    const double temperature_c =
        theta.reference_temperature_c + random.Uniform(-80, 80);
    const Calibration seen = AtTemperature(theta, temperature_c);
    const Eigen::MatrixXd analytic =
        TemperatureDerivative(theta, temperature_c);
    ASSERT_EQ(analytic.rows(), TangentSize(seen));
    ASSERT_EQ(analytic.cols(), TangentSize(theta));
    constexpr double kStep = 1e-6;
    for (int j = 0; j < analytic.cols(); ++j) {
      const Eigen::VectorXd step =
          kStep * Eigen::VectorXd::Unit(analytic.cols(), j);
      const Eigen::VectorXd numeric =
          (BoxMinus(AtTemperature(BoxPlus(theta, step), temperature_c), seen) -
           BoxMinus(AtTemperature(BoxPlus(theta, -step), temperature_c),
                    seen)) /
          (2 * kStep);
      ASSERT_LT((numeric - analytic.col(j)).norm(),
                1e-6 * (1 + analytic.col(j).norm()))
          << j;
    }
  }
}

TEST(Temperature, ASegmentWithoutOneSeesTheReference) {
  RandomValues random(4);
  const Calibration theta = WithAllSlopes(&random, random.Theta());
  MotionSegment segment;
  EXPECT_EQ(TemperatureOf(theta, segment), theta.reference_temperature_c);
  segment.temperature_c = 71;
  const SegmentTheta seen(theta, segment);
  EXPECT_TRUE(seen.varies());
  EXPECT_TRUE(BoxMinus(*seen, AtTemperature(theta, 71)).isZero(0));
  const Calibration plain = random.Theta();
  EXPECT_EQ(&*SegmentTheta(plain, segment), &plain);
}

TEST(Temperature, SlopesOfOtherReferencesAreOfAnotherShape) {
  RandomValues random(5);
  const Calibration plain = random.Theta();
  Calibration theta = WithAllSlopes(&random, plain);
  EXPECT_FALSE(SameShape(theta, plain));
  Calibration other = theta;
  EXPECT_TRUE(SameShape(theta, other));
  other.reference_temperature_c += 1;
  EXPECT_FALSE(SameShape(theta, other));
  Calibration elsewhere = plain;
  elsewhere.reference_temperature_c += 1;
  EXPECT_TRUE(SameShape(plain, elsewhere));
}

TEST(Temperature, SlopesOfADistortionAreThoseOfItsCoefficients) {
  Calibration theta;
  theta.cameras.resize(1);
  theta.cameras[0].model = DistortionModel::kRadialTangential;
  theta.cameras[0].distortion.setZero(4);
  Rig rig;
  rig.blocks = {{"cam0.distortion_slope", true},
                {"cam0.time_offset_slope", true}};
  AddEstimatedBlocks(rig.blocks, &theta);
  rig.factory = theta;
  rig.groups = DefaultGroups(rig.blocks, theta);
  const auto components = TangentComponents(theta);
  const std::size_t first = components.size() - 5;
  EXPECT_EQ(components[first].name, "cam0.distortion_slope.k1");
  EXPECT_EQ(components[first + 3].name, "cam0.distortion_slope.p2");
  EXPECT_EQ(components[first + 4].name, "cam0.time_offset_slope");
  EXPECT_EQ(components[first + 4].unit, "s/K");
  const double of_k1 =
      components[CameraTangentOffset(theta, 0) + kCameraDistortion].sigma_ref;
  const Eigen::VectorXd prior = PriorSigmas(rig);
  EXPECT_DOUBLE_EQ(components[first].sigma_ref, 0.05 * of_k1);
  EXPECT_NEAR(prior(static_cast<int>(first)), 0.01 * of_k1, 1e-12 * of_k1);
  // A slope depends on the time offset, which itself is held.
  EXPECT_EQ(EstimatedTimeOffsets(rig), std::vector<char>{1});
  theta.cameras[0].distortion_slope.resize(3);
  bool found = false;
  for (const Violation& violation : Validate(theta, "")) {
    found |= violation.field == "cameras[0].distortion_slope";
  }
  EXPECT_TRUE(found);
}

TEST(Temperature, SlopesAreAddedWhereARigEstimatesThem) {
  Calibration theta;
  theta.cameras.resize(2);
  theta.cameras[1].width_px = 1280;
  AddEstimatedBlocks(
      {{"imu.gyro.scale_slope", true}, {"cam1.focal_slope", true}}, &theta);
  Rig rig;
  rig.factory = theta;
  rig.blocks = {{"imu.gyro.scale_slope", true}, {"cam1.focal_slope", true}};
  rig.groups = DefaultGroups(rig.blocks, theta);
  const auto components = TangentComponents(theta);
  const std::size_t first = components.size() - 5;
  EXPECT_EQ(components[first].name, "imu.gyro.scale_slope.x");
  EXPECT_EQ(components[first].unit, "1/K");
  EXPECT_EQ(components[first + 4].name, "cam1.focal_slope.y");
  // Twice as many pixels.
  EXPECT_DOUBLE_EQ(PriorSigmas(rig)(static_cast<int>(first) + 4), 0.1);
  const std::vector<int> camera = GroupComponents(rig, rig.groups[1]);
  EXPECT_EQ(camera.back(), static_cast<int>(first) + 4);
  rig.blocks.clear();
  EXPECT_EQ(FreeComponents(rig).back() < static_cast<int>(first), true)
      << "a slope that a rig has is known unless it says otherwise";
}

}  // namespace
}  // namespace selfcal
