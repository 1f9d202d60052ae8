#include "test/evaluation/trust_device.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "test/evaluation/trust_kinds.h"
#include "test/evaluation/trust_simulation.h"

namespace selfcal {
namespace {

TEST(TrustErrorTest, IsTheNormalisedErrorWithItsLargestComponent) {
  const TrustDevice device = MakeTrustDevice(1);
  const auto components = TangentComponents(device.rig.factory);
  const std::vector<int> free = FreeComponents(device.rig);
  const Eigen::Index size = TangentSize(device.rig.factory);
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(size, size);
  Eigen::VectorXd error = Eigen::VectorXd::Zero(size);
  for (const int i : free) {
    covariance(i, i) = 1e-8;
    error(i) = 1e-4;
  }
  error(free[7]) = -3e-4;
  const Calibration theta = BoxPlus(*device.truth, error);
  const TrustError result =
      ErrorAgainst(device.rig, *device.truth, theta, covariance);
  const auto count = static_cast<int>(free.size());
  EXPECT_EQ(result.degrees, count);
  EXPECT_NEAR(result.nees, count - 1 + 9, 1e-6);
  EXPECT_NEAR(result.sigmas, 3, 1e-6);
  EXPECT_EQ(result.component, components[free[7]].name);
  EXPECT_FALSE(IsFailure(result));
}

TEST(TrustErrorTest, OneComponentFarOffOrManyALittleAreAFailure) {
  TrustError error{26, 26, 0.5, 4.4, ""};
  EXPECT_FALSE(IsFailure(error));
  error.sigmas = 4.6;
  EXPECT_TRUE(IsFailure(error));
  error.sigmas = 3;
  error.probability = 0.9e-4;
  EXPECT_TRUE(IsFailure(error));
  error.probability = 1.1e-4;
  EXPECT_FALSE(IsFailure(error));
}

TEST(TrustErrorTest, AnErrorThatIsNotANumberIsAFailure) {
  EXPECT_TRUE(IsFailure({26, 26, 0.5, std::nan(""), ""}));
  EXPECT_TRUE(IsFailure({26, 26, std::nan(""), 3, ""}));
}

TEST(TrustKindsTest, NamesAndSeedsAreDistinct) {
  std::set<std::string> names;
  std::set<std::uint64_t> seeds;
  int devices = 0;
  for (const TrustKind& kind : TrustKinds()) {
    EXPECT_TRUE(names.insert(kind.name).second) << kind.name;
    EXPECT_LE(kind.quick_devices, kind.devices);
    devices += kind.devices;
    for (const TrustSeeds set : {TrustSeeds::kJudging, TrustSeeds::kDesign}) {
      for (int i = 0; i < kind.devices; ++i) {
        EXPECT_TRUE(seeds.insert(SeedOf(kind, set, i)).second) << kind.name;
      }
    }
  }
  EXPECT_GE(devices, 300);
}

TEST(TrustKindsTest, ADeviceIsAFunctionOfItsSeed) {
  const TrustKind& kind = TrustKinds().front();
  const auto a = kind.make(kind.first_seed);
  const auto b = kind.make(kind.first_seed);
  const auto c = kind.make(kind.first_seed + 1);
  ASSERT_TRUE(a && b && c);
  EXPECT_EQ(BoxMinus(*a->truth, *b->truth).norm(), 0);
  EXPECT_EQ(BoxMinus(a->rig.factory, b->rig.factory).norm(), 0);
  EXPECT_GT(BoxMinus(*a->truth, *c->truth).norm(), 0);
  EXPECT_GT(BoxMinus(a->rig.factory, c->rig.factory).norm(), 0);
}

}  // namespace
}  // namespace selfcal
