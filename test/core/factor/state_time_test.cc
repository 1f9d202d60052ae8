#include "core/factor/state_time.h"

#include <gtest/gtest.h>

#include "core/simulation/imu_readings.h"
#include "core/simulation/simulate.h"

namespace selfcal {
namespace {

// A hand-held device with scales, misalignments and biases, without noise.
class StateTime : public ::testing::Test {
 protected:
  static SimulationOptions WithoutNoise() {
    SimulationOptions options;
    options.noise = false;
    return options;
  }

  KeyframeState TrueAt(std::int64_t t_ns) const {
    return TrueState(*trajectory_, imu_, t_ns);
  }

  const Rig rig_ = HandheldRig("a");
  const Calibration theta_ = PerturbCalibration(rig_.factory, {}, 3);
  const std::unique_ptr<Trajectory> trajectory_ = MakeHandheld(20, 1, 7);
  const ImuReadings imu_ =
      SimulateImu(rig_, theta_.imu, *trajectory_, WithoutNoise());
};

TEST_F(StateTime, MovesAlongTheTrueMotion) {
  for (std::int64_t t_ms = 500; t_ms < 19'500; t_ms += 137) {
    for (const std::int64_t offset_us : {-12'300, -2'000, 1'700, 7'000}) {
      const std::int64_t t_ns = t_ms * 1'000'000;
      const KeyframeState moved = MoveState(TrueAt(t_ns + offset_us * 1000),
                                            t_ns,
                                            imu_.noise_free,
                                            theta_.imu,
                                            rig_.gravity_mps2);
      const KeyframeState truth = TrueAt(t_ns);
      EXPECT_EQ(moved.t_ns, t_ns);
      // Far below what a pixel resolves: 1e-4 rad is 0.03 px.
      EXPECT_LT(moved.q_GI.angularDistance(truth.q_GI), 2e-5);
      EXPECT_LT((moved.p_GI - truth.p_GI).norm(), 1e-5);
      EXPECT_LT((moved.v_GI - truth.v_GI).norm(), 2e-3);
      EXPECT_EQ(moved.b_a, TrueAt(t_ns + offset_us * 1000).b_a);
    }
  }
}

TEST_F(StateTime, LeavesAStateAtItsTimeAsItIs) {
  const KeyframeState state = TrueAt(1'000'000'000);
  const KeyframeState same = MoveState(
      state, state.t_ns, imu_.noise_free, theta_.imu, rig_.gravity_mps2);
  EXPECT_EQ(same.q_GI.coeffs(), state.q_GI.coeffs());
  EXPECT_EQ(same.p_GI, state.p_GI);
  EXPECT_EQ(same.v_GI, state.v_GI);
}

TEST_F(StateTime, ChangesOnlyTheTimeWithoutSamples) {
  const KeyframeState state = TrueAt(1'000'000'000);
  const KeyframeState moved = MoveState(state, 5, {}, theta_.imu, 9.81);
  EXPECT_EQ(moved.t_ns, 5);
  EXPECT_EQ(moved.p_GI, state.p_GI);
}

}  // namespace
}  // namespace selfcal
