#include "core/model/calibration.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <set>
#include <string>

#include "core/model/rig.h"
#include "core/model/so3.h"
#include "test/core/model/random_values.h"

namespace selfcal {
namespace {

constexpr int kCalibrationTrials = 1000;

TEST(ImuCalibration, MatricesAreUpperTriangularAsDocumented) {
  ImuCalibration imu;
  imu.s_g = {1, 2, 3};
  imu.m_g = {4, 5, 6};
  imu.s_a = {7, 8, 9};
  imu.m_a = {10, 11, 12};
  Eigen::Matrix3d T_g;
  T_g << 1, 4, 5, 0, 2, 6, 0, 0, 3;
  Eigen::Matrix3d T_a;
  T_a << 7, 10, 11, 0, 8, 12, 0, 0, 9;
  EXPECT_EQ(imu.T_g(), T_g);
  EXPECT_EQ(imu.T_a(), T_a);
}

TEST(Calibration, TangentSizesAddUp) {
  RandomValues random(1);
  const Calibration theta = random.Theta();
  EXPECT_EQ(CameraTangentSize(theta.cameras[0]), 12);
  EXPECT_EQ(CameraTangentSize(theta.cameras[1]), 15);
  EXPECT_EQ(CameraTangentSize(theta.cameras[2]), 15);
  EXPECT_EQ(CameraTangentOffset(theta, 0), 15);
  EXPECT_EQ(CameraTangentOffset(theta, 1), 27);
  EXPECT_EQ(CameraTangentOffset(theta, 2), 42);
  EXPECT_EQ(TimeOffsetComponent(theta, 0), 26);
  EXPECT_EQ(TimeOffsetComponent(theta, 2), 56);
  EXPECT_EQ(TangentSize(theta), 57);
}

TEST(Calibration, BoxPlusOfZeroChangesNothing) {
  RandomValues random(2);
  const Calibration theta = random.Theta();
  const Eigen::VectorXd zero = Eigen::VectorXd::Zero(TangentSize(theta));
  EXPECT_LT(BoxMinus(BoxPlus(theta, zero), theta).norm(), 1e-15);
  EXPECT_TRUE(BoxMinus(theta, theta).isZero(0));
}

TEST(Calibration, BoxMinusInvertsBoxPlus) {
  RandomValues random(3);
  for (int i = 0; i < kCalibrationTrials; ++i) {
    const Calibration theta = random.Theta();
    // Rotations by up to sqrt(3) 1.8 < pi.
    const Eigen::VectorXd delta = random.Vector(TangentSize(theta), 1.8);
    const Calibration moved = BoxPlus(theta, delta);
    EXPECT_LT((BoxMinus(moved, theta) - delta).norm(), 1e-12);
  }
}

TEST(Calibration, BoxPlusInvertsBoxMinus) {
  RandomValues random(4);
  for (int i = 0; i < kCalibrationTrials; ++i) {
    const Calibration a = random.Theta();
    const Calibration b = random.Theta();
    const Calibration again = BoxPlus(b, BoxMinus(a, b));
    EXPECT_LT(BoxMinus(again, a).norm(), 1e-12);
  }
}

TEST(Calibration, BoxPlusTurnsRotationsOnTheRightAndAddsTheRest) {
  RandomValues random(5);
  const Calibration theta = random.Theta();
  const Eigen::VectorXd delta = random.Vector(TangentSize(theta), 0.5);
  const Calibration moved = BoxPlus(theta, delta);
  EXPECT_LT((moved.imu.s_g - theta.imu.s_g - delta.segment<3>(0)).norm(),
            1e-15);
  EXPECT_LT((moved.imu.m_g - theta.imu.m_g - delta.segment<3>(3)).norm(),
            1e-15);
  EXPECT_LT((moved.imu.s_a - theta.imu.s_a - delta.segment<3>(6)).norm(),
            1e-15);
  EXPECT_LT((moved.imu.m_a - theta.imu.m_a - delta.segment<3>(9)).norm(),
            1e-15);
  EXPECT_LT(moved.imu.q_AI.angularDistance(theta.imu.q_AI *
                                           Exp(delta.segment<3>(12))),
            1e-15);
  const CameraCalibration& from = theta.cameras[1];
  const CameraCalibration& to = moved.cameras[1];
  EXPECT_LT(to.q_CI.angularDistance(from.q_CI * Exp(delta.segment<3>(27))),
            1e-15);
  EXPECT_LT((to.p_CI - from.p_CI - delta.segment<3>(30)).norm(), 1e-15);
  EXPECT_LT((to.f - from.f - delta.segment<2>(33)).norm(), 1e-12);
  EXPECT_LT((to.c - from.c - delta.segment<2>(35)).norm(), 1e-12);
  EXPECT_LT((to.distortion - from.distortion - delta.segment<4>(37)).norm(),
            1e-15);
  EXPECT_NEAR(to.time_offset_s, from.time_offset_s + delta[41], 1e-15);
  EXPECT_EQ(to.width_px, from.width_px);
  EXPECT_EQ(to.height_px, from.height_px);
}

TEST(Calibration, RotationsStayUnitAfterManySteps) {
  RandomValues random(6);
  Calibration theta = random.Theta();
  for (int i = 0; i < 10000; ++i) {
    theta = BoxPlus(theta, random.Vector(TangentSize(theta), 0.1));
  }
  EXPECT_NEAR(theta.imu.q_AI.norm(), 1, 1e-15);
  EXPECT_NEAR(theta.cameras[0].q_CI.norm(), 1, 1e-15);
}

TEST(Calibration, ShapeIsTheNumberOfCamerasAndTheirModels) {
  RandomValues random(7);
  const Calibration theta = random.Theta();
  EXPECT_TRUE(SameShape(theta, random.Theta()));
  Calibration fewer = theta;
  fewer.cameras.pop_back();
  EXPECT_FALSE(SameShape(theta, fewer));
  Calibration other = theta;
  other.cameras[1] = random.Camera(DistortionModel::kEquidistant);
  EXPECT_FALSE(SameShape(theta, other));
}

TEST(Calibration, ABlockThatACameraLacksHasNoComponents) {
  RandomValues random(12);
  const Calibration without = random.Theta();
  Calibration theta = without;
  theta.cameras[1].line_delay_s = 3e-5;
  EXPECT_FALSE(SameShape(theta, without));
  EXPECT_EQ(TangentSize(theta), TangentSize(without) + 1);
  const int at = TimeOffsetComponent(theta, 1) + 1;
  EXPECT_EQ(at, CameraTangentOffset(theta, 2) - 1);
  const auto components = TangentComponents(theta);
  EXPECT_EQ(components[at].name, "cam1.line_delay");
  EXPECT_EQ(components[at].unit, "s");
  EXPECT_EQ(ReadableValues(theta)[at], 3e-5);
  const Eigen::VectorXd delta = random.Vector(TangentSize(theta), 1e-5);
  const Calibration moved = BoxPlus(theta, delta);
  EXPECT_EQ(moved.cameras[1].line_delay_s, 3e-5 + delta[at]);
  EXPECT_FALSE(moved.cameras[0].line_delay_s);
  EXPECT_LT((BoxMinus(moved, theta) - delta).norm(), 1e-12);
  theta.cameras[1].line_delay_s = 2e-3;
  const auto violations = Validate(theta, "");
  ASSERT_EQ(violations.size(), 1u);
  EXPECT_EQ(violations[0].field, "cameras[1].line_delay_s");
}

TEST(Calibration, ASecondImuFollowsTheFirst) {
  RandomValues random(15);
  const Calibration theta = random.ThetaOfTwoImus();
  Calibration without = theta;
  without.imu1.reset();
  EXPECT_FALSE(SameShape(theta, without));
  const int first = ImuTangentSize(theta.imu);
  const int size = kImuTangentSize + 9 + 3 + 6 + 1;
  EXPECT_EQ(TangentSize(theta), TangentSize(without) + size);
  EXPECT_EQ(LinkTangentSize(theta), first + size);
  EXPECT_EQ(CameraTangentOffset(theta, 0), first + size);
  const auto components = TangentComponents(theta);
  EXPECT_EQ(components[first].name, "imu1.gyro.scale.x");
  EXPECT_EQ(components[first + size - 7].name, "imu1.q_JI.x");
  EXPECT_EQ(components[first + size - 2].name, "imu1.p_JI.z");
  EXPECT_EQ(components[first + size - 2].unit, "m");
  EXPECT_EQ(components[first + size - 1].name, "imu1.time_offset");
  const Eigen::VectorXd delta = random.Vector(TangentSize(theta), 0.1);
  const Calibration moved = BoxPlus(theta, delta);
  EXPECT_LT((BoxMinus(moved, theta) - delta).norm(), 1e-12);
  EXPECT_LT(
      (moved.imu1->p_JI - theta.imu1->p_JI - delta.segment<3>(first + size - 4))
          .norm(),
      1e-15);
  Calibration broken = theta;
  broken.imu1->q_JI.coeffs() *= 2;
  broken.imu1->s_a.x() = -1;
  const auto violations = Validate(broken, "factory");
  ASSERT_EQ(violations.size(), 2u);
  EXPECT_EQ(violations[0].field, "factory.imu1.s_a");
  EXPECT_EQ(violations[1].field, "factory.imu1.q_JI");
}

TEST(OptionalBlocks, TheDriftOfAClockFollowsALineDelay) {
  RandomValues random(14);
  Calibration theta = random.Theta();
  theta.cameras[0].time_drift = 2e-5;
  theta.cameras[1].line_delay_s = 3e-5;
  theta.cameras[1].time_drift = -1e-5;
  const auto components = TangentComponents(theta);
  const int first = TimeOffsetComponent(theta, 0) + 1;
  const int second = TimeOffsetComponent(theta, 1) + 2;
  EXPECT_EQ(components[first].name, "cam0.time_drift");
  EXPECT_EQ(components[first].unit, "s/s");
  EXPECT_EQ(components[second].name, "cam1.time_drift");
  EXPECT_EQ(second, CameraTangentOffset(theta, 2) - 1);
  const Eigen::VectorXd delta = random.Vector(TangentSize(theta), 1e-5);
  const Calibration moved = BoxPlus(theta, delta);
  EXPECT_EQ(moved.cameras[1].time_drift, -1e-5 + delta[second]);
  EXPECT_EQ(TimeOffsetAt(theta.cameras[0], 500),
            theta.cameras[0].time_offset_s + 0.01);
  theta.cameras[0].time_drift = 0.02;
  const auto violations = Validate(theta, "");
  ASSERT_EQ(violations.size(), 1u);
  EXPECT_EQ(violations[0].field, "cameras[0].time_drift");
}

Calibration Coupled(int positions, RandomValues* random) {
  Calibration theta = random->Theta();
  theta.imu.gyro_g_sensitivity = random->Vector(9, 1e-3);
  theta.imu.accel_position = random->Vector(positions, 0.1);
  return theta;
}

TEST(OptionalBlocks, OfAnImuAreComponentsWhereItHasThem) {
  RandomValues random(13);
  const Calibration plain = random.Theta();
  EXPECT_EQ(ImuTangentSize(plain.imu), 15);
  for (const int positions : {0, 3, 9}) {
    const Calibration theta = Coupled(positions, &random);
    EXPECT_EQ(ImuTangentSize(theta.imu), 15 + 9 + positions);
    EXPECT_EQ(CameraTangentOffset(theta, 0), 15 + 9 + positions);
    EXPECT_EQ(TangentSize(theta), TangentSize(plain) + 9 + positions);
    EXPECT_FALSE(SameShape(theta, plain));
    const auto components = TangentComponents(theta);
    EXPECT_EQ(components[15].name, "imu.gyro.g_sensitivity.x.x");
    EXPECT_EQ(components[16].name, "imu.gyro.g_sensitivity.x.y");
    EXPECT_EQ(components[23].name, "imu.gyro.g_sensitivity.z.z");
    EXPECT_EQ(components[24].name,
              positions == 0   ? "cam0.q_CI.x"
              : positions == 3 ? "imu.accel.position.x"
                               : "imu.accel.position.x.x");
    const Eigen::VectorXd delta = random.Vector(TangentSize(theta), 0.1);
    const Calibration moved = BoxPlus(theta, delta);
    EXPECT_LT((BoxMinus(moved, theta) - delta).norm(), 1e-12);
    const Eigen::Matrix3d more = moved.imu.T_s() - theta.imu.T_s();
    EXPECT_NEAR(more(0, 1), delta[16], 1e-15);
    EXPECT_NEAR(more(1, 0), delta[18], 1e-15);
    for (int j = 0; j < 3 && positions > 0; ++j) {
      const Eigen::Vector3d shift =
          moved.imu.AccelPositions().col(j) - theta.imu.AccelPositions().col(j);
      const int at = 24 + (positions == 9 ? 3 * j : 0);
      EXPECT_LT((shift - delta.segment<3>(at)).norm(), 1e-15);
    }
  }
}

TEST(OptionalBlocks, HaveOneOfTheirSizes) {
  RandomValues random(14);
  Calibration theta = Coupled(3, &random);
  EXPECT_TRUE(Validate(theta, "").empty());
  theta.imu.gyro_g_sensitivity.resize(3);
  theta.imu.accel_position = random.Vector(6, 0.1);
  auto violations = Validate(theta, "");
  ASSERT_EQ(violations.size(), 2u);
  EXPECT_EQ(violations[0].field, "imu.gyro_g_sensitivity");
  EXPECT_EQ(violations[0].message, "has 3 values; it may have 0 or 9");
  EXPECT_EQ(violations[1].field, "imu.accel_position");
  EXPECT_EQ(violations[1].message, "has 6 values; it may have 0, 3 or 9");
  theta = Coupled(9, &random);
  theta.imu.accel_position[4] = 20;
  violations = Validate(theta, "");
  ASSERT_EQ(violations.size(), 1u);
  EXPECT_EQ(violations[0].field, "imu.accel_position");
}

TEST(TangentComponents, AreAsManyAsTheTangentHasDimensions) {
  RandomValues random(8);
  const Calibration theta = random.Theta();
  EXPECT_EQ(static_cast<int>(TangentComponents(theta).size()),
            TangentSize(theta));
}

TEST(TangentComponents, NamesAreUnique) {
  RandomValues random(9);
  Calibration theta = random.Theta();
  for (int j = 0; j < 10; ++j) theta.cameras.push_back(theta.cameras[j % 3]);
  std::set<std::string> names;
  for (const TangentComponent& component : TangentComponents(theta)) {
    EXPECT_TRUE(names.insert(component.name).second) << component.name;
  }
}

TEST(TangentComponents, StandAtTheOffsetsOfTheirBlocks) {
  RandomValues random(10);
  const Calibration theta = random.Theta();
  const auto components = TangentComponents(theta);
  const auto expect = [&](int i, const char* name, const char* unit) {
    EXPECT_EQ(components[i].name, name);
    EXPECT_EQ(components[i].unit, unit);
  };
  expect(kGyroScale, "imu.gyro.scale.x", "-");
  expect(kGyroMisalignment + 1, "imu.gyro.misalignment.y", "-");
  expect(kAccelScale + 2, "imu.accel.scale.z", "-");
  expect(kAccelMisalignment, "imu.accel.misalignment.x", "-");
  expect(kAccelRotation, "imu.q_AI.x", "rad");
  const int cam0 = CameraTangentOffset(theta, 0);
  expect(cam0 + kCameraRotation, "cam0.q_CI.x", "rad");
  expect(cam0 + kCameraPosition + 2, "cam0.p_CI.z", "m");
  expect(cam0 + kCameraIntrinsics, "cam0.focal.x", "px");
  expect(cam0 + kCameraIntrinsics + 3, "cam0.principal.y", "px");
  expect(cam0 + kCameraDistortion, "cam0.distortion.w", "-");
  expect(TimeOffsetComponent(theta, 0), "cam0.time_offset", "s");
  const int cam1 = CameraTangentOffset(theta, 1);
  expect(cam1 + kCameraIntrinsics + 4, "cam1.distortion.k1", "-");
  expect(cam1 + kCameraIntrinsics + 7, "cam1.distortion.p2", "-");
  const int cam2 = CameraTangentOffset(theta, 2);
  expect(cam2 + kCameraIntrinsics + 7, "cam2.distortion.k4", "-");
  expect(TimeOffsetComponent(theta, 2), "cam2.time_offset", "s");
}

TEST(TangentComponents, ReferenceSigmasAreEqualOnTheAxesOfABlock) {
  RandomValues random(11);
  const auto components = TangentComponents(random.Theta());
  for (const TangentComponent& component : components) {
    EXPECT_GT(component.sigma_ref, 0) << component.name;
    const std::string block =
        component.name.substr(0, component.name.rfind('.'));
    for (const TangentComponent& other : components) {
      // The coefficients of a distortion are not axes, and a single parameter
      // of a camera is not a block.
      if (block.ends_with("distortion")) continue;
      if (component.name.ends_with("time_offset")) continue;
      if (!other.name.starts_with(block + ".")) continue;
      EXPECT_EQ(component.sigma_ref, other.sigma_ref) << component.name;
    }
  }
}

TEST(ReadableValues, AreTheNumbersAPersonWouldWrite) {
  RandomValues random(12);
  Calibration theta = random.Theta();
  theta.imu.s_g = {1.01, 0.99, 1.02};
  const Eigen::Vector3d phi(0.1, -0.2, 3.0);
  theta.cameras[0].q_CI = Exp(phi);
  theta.cameras[0].f = {255, 256};
  theta.cameras[0].distortion[0] = 0.92;
  theta.cameras[0].time_offset_s = -0.003;
  const Eigen::VectorXd values = ReadableValues(theta);
  ASSERT_EQ(values.size(), TangentSize(theta));
  EXPECT_EQ(values.segment<3>(0), theta.imu.s_g);
  EXPECT_LT((values.segment<3>(15) - phi).norm(), 1e-14);
  EXPECT_EQ(values.segment<3>(18), theta.cameras[0].p_CI);
  EXPECT_EQ(values[21], 255);
  EXPECT_EQ(values[25], 0.92);
  EXPECT_EQ(values[26], -0.003);
}

}  // namespace
}  // namespace selfcal
