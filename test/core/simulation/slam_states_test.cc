#include "core/simulation/slam_states.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/model/so3.h"
#include "test/core/simulation/rigs.h"

namespace selfcal {
namespace {

struct Truth {
  Rig rig = HandheldRig("a");
  SimulationOptions options;
  ImuReadings imu;
  std::vector<KeyframeState> states;
};

Truth MakeTruth(double duration_s, const SimulationOptions& options) {
  Truth truth;
  truth.options = options;
  const auto trajectory = MakeHandheld(duration_s, 1, 1);
  truth.imu =
      SimulateImu(truth.rig, truth.rig.factory.imu, *trajectory, options);
  for (int k = 0; k + 1 < 10 * duration_s; ++k) {
    truth.states.push_back(
        TrueState(*trajectory, truth.imu, 1'700'000LL + 100'000'000LL * k));
  }
  return truth;
}

TEST(SlamStatesTest, ErrorsHaveTheStandardDeviationsOfTheOptions) {
  const Truth truth = MakeTruth(3000, {});
  const ImuCalibration& imu = truth.rig.factory.imu;
  const auto slam =
      SlamStates(truth.states, truth.imu, imu, imu, truth.options);
  ASSERT_EQ(slam.size(), truth.states.size());
  double tilt = 0, yaw = 0, p = 0, v = 0, b_a = 0, b_g = 0;
  for (std::size_t k = 0; k < slam.size(); ++k) {
    const KeyframeState& x = truth.states[k];
    const Eigen::Vector3d rotation_G =
        x.q_GI * Log(x.q_GI.conjugate() * slam[k].q_GI);
    tilt += rotation_G.head<2>().squaredNorm() / 2;
    yaw += rotation_G.z() * rotation_G.z();
    p += (slam[k].p_GI - x.p_GI).squaredNorm() / 3;
    v += (slam[k].v_GI - x.v_GI).squaredNorm() / 3;
    b_a += (slam[k].b_a - x.b_a).squaredNorm() / 3;
    b_g += (slam[k].b_g - x.b_g).squaredNorm() / 3;
  }
  const auto rms = [&](double sum) {
    return std::sqrt(sum / static_cast<double>(slam.size()));
  };
  // 3000 s hold 75 independent values for each axis of the slowest errors.
  EXPECT_NEAR(rms(tilt) / truth.options.slam_rotation_rad, 1, 0.15);
  EXPECT_NEAR(rms(yaw) / (3 * truth.options.slam_rotation_rad), 1, 0.4);
  EXPECT_NEAR(rms(p) / truth.options.slam_position_m, 1, 0.25);
  EXPECT_NEAR(rms(v) / truth.options.slam_velocity_mps, 1, 0.1);
  EXPECT_NEAR(rms(b_a) / truth.options.slam_accel_bias_mps2, 1, 0.25);
  EXPECT_NEAR(rms(b_g) / truth.options.slam_gyro_bias_radps, 1, 0.25);
}

TEST(SlamStatesTest, PosesDriftRatherThanJump) {
  const Truth truth = MakeTruth(300, {});
  const ImuCalibration& imu = truth.rig.factory.imu;
  const auto slam =
      SlamStates(truth.states, truth.imu, imu, imu, truth.options);
  double step = 0;
  for (std::size_t k = 0; k + 1 < slam.size(); ++k) {
    const Eigen::Vector3d error = slam[k].p_GI - truth.states[k].p_GI;
    const Eigen::Vector3d next = slam[k + 1].p_GI - truth.states[k + 1].p_GI;
    step += (next - error).squaredNorm() / 3;
  }
  // Independent errors would differ by sqrt(2) of their standard deviation.
  EXPECT_LT(std::sqrt(step / static_cast<double>(slam.size())),
            0.4 * truth.options.slam_position_m);
}

// Mean over the session of the part of the noise-free readings that the
// calibration and the bias of the SLAM system do not explain.
TEST(SlamStatesTest, BiasesAbsorbTheMeanErrorOfTheCalibration) {
  SimulationOptions options = PerfectSlam();
  options.noise = false;
  const Truth truth = MakeTruth(120, options);
  const ImuCalibration& imu_true = truth.rig.factory.imu;
  const ImuCalibration imu_slam =
      PerturbCalibration(truth.rig.factory, {}, 1).imu;
  const auto slam =
      SlamStates(truth.states, truth.imu, imu_true, imu_slam, options);
  Eigen::Vector3d with_true_bias = Eigen::Vector3d::Zero();
  Eigen::Vector3d with_slam_bias = Eigen::Vector3d::Zero();
  for (std::size_t k = 50; k + 50 < slam.size(); ++k) {
    const std::size_t i =
        SampleBefore(truth.imu.measured, truth.states[k].t_ns);
    const Eigen::Vector3d unexplained =
        truth.imu.measured[i].accel -
        imu_slam.T_a() * (imu_slam.q_AI * truth.imu.f_I[i]);
    with_true_bias += unexplained - truth.states[k].b_a;
    with_slam_bias += unexplained - slam[k].b_a;
  }
  EXPECT_LT(with_slam_bias.norm(), 0.05 * with_true_bias.norm());
  EXPECT_GT((slam[300].b_a - truth.states[300].b_a).norm(), 0.02);
  EXPECT_LT((slam[300].p_GI - truth.states[300].p_GI).norm(), 1e-12);
}

}  // namespace
}  // namespace selfcal
