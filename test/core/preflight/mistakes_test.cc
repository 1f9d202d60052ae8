// Each of the usual mistakes, planted in simulated data, is found and named,
// and nothing else is.
#include "test/core/preflight/mistakes.h"

#include "core/simulation/simulate.h"
#include "test/core/preflight/expect_found.h"
#include "test/core/simulation/rigs.h"

namespace selfcal {
namespace {

FedData Simulated(const Rig& rig, const Trajectory& trajectory, int seed) {
  SimulationOptions options;
  options.seed = seed;
  FedData data;
  data.rig = rig;
  data.rig.factory = PerturbCalibration(rig.factory, {}, seed);
  data.segments =
      Simulate(
          rig, rig.factory, data.rig.factory, trajectory, "session", options)
          .segments;
  return data;
}

void ExpectAllFound(const FedData& clean) {
  const Diagnosis diagnosis = clean.Diagnose();
  ASSERT_TRUE(diagnosis.findings.empty()) << Text(diagnosis);
  for (const Mistake& mistake : Mistakes()) ExpectFound(mistake, clean);
}

TEST(Mistakes, AreFoundInVigorousMotion) {
  ExpectAllFound(Simulated(HandheldRig("rig"), *MakeHandheld(40, 1, 1), 1));
}

TEST(Mistakes, AreFoundInCalmMotion) {
  ExpectAllFound(Simulated(HandheldRig("rig"), *MakeHandheld(40, 0.2, 2), 2));
}

TEST(Mistakes, AreFoundInMixedMotion) {
  ExpectAllFound(Simulated(HandheldRig("rig"), *MakeMixed(60, 3), 3));
}

// At rest nothing can be said about rates, and it is not.
TEST(Mistakes, OfTheGyroscopeAreNotCheckedAtRest) {
  FedData data = Simulated(HandheldRig("rig"), *MakeRest(40), 4);
  for (MotionSegment& segment : data.segments) {
    for (ImuSample& sample : segment.imu) sample.gyro *= -1;
  }
  const Diagnosis diagnosis = data.Diagnose();
  EXPECT_TRUE(diagnosis.findings.empty()) << Text(diagnosis);
  ASSERT_EQ(diagnosis.not_checked.size(), 1);
  EXPECT_NE(diagnosis.not_checked[0].find("hardly turns"), std::string::npos);
}

}  // namespace
}  // namespace selfcal
