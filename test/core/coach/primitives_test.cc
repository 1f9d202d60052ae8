#include "core/coach/primitives.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>
#include <string>

#include "core/model/so3.h"
#include "core/simulation/simulate.h"

namespace selfcal {
namespace {

constexpr double kDuration_s = 4.1;
constexpr double kStep_s = 0.02;
constexpr int kPeople = 20;

struct Vigour {
  double rate_radps = 0;
  double accel_mps2 = 0;
};

// Root mean squares over many performances.
template <typename Make>
Vigour MeanVigour(const Make& make) {
  double rate = 0, accel = 0;
  int count = 0;
  for (std::uint64_t seed = 1; seed <= kPeople; ++seed) {
    const std::unique_ptr<Trajectory> trajectory = make(seed);
    for (double t = 0; t < kDuration_s - kStep_s; t += kStep_s) {
      const BodyMotion motion = trajectory->At(t);
      rate += motion.w_I.squaredNorm();
      accel += motion.a_GI.squaredNorm();
      ++count;
    }
  }
  return {std::sqrt(rate / count), std::sqrt(accel / count)};
}

Vigour VigourOf(const Primitive& primitive, const Calibration& theta) {
  return MeanVigour([&](std::uint64_t seed) {
    return Perform(primitive, theta, kDuration_s, seed);
  });
}

TEST(Primitives, HaveNamesAndInstructions) {
  std::set<std::string_view> names, instructions;
  for (const Primitive& primitive : Primitives()) {
    EXPECT_EQ(primitive.name.find_first_not_of("abcdefghijklmnopqrstuvwxyz_"),
              std::string_view::npos);
    EXPECT_FALSE(primitive.instruction.empty());
    EXPECT_EQ(primitive.instruction.back(), '.');
    names.insert(primitive.name);
    instructions.insert(primitive.instruction);
    EXPECT_EQ(FindPrimitive(primitive.name), &primitive);
  }
  EXPECT_EQ(names.size(), Primitives().size());
  EXPECT_EQ(instructions.size(), Primitives().size());
  EXPECT_EQ(Primitives().front().name, "hold_still");
  EXPECT_EQ(FindPrimitive("moonwalk"), nullptr);
}

// Their higher gain relative to being carried about is not due to being faster.
TEST(Primitives, AreNoMoreVigorousThanBeingCarriedAbout) {
  const Calibration theta = HandheldRig("r").factory;
  const Vigour carried = MeanVigour(
      [](std::uint64_t seed) { return MakeHandheld(kDuration_s, 1, seed); });
  for (const Primitive& primitive : Primitives()) {
    const Vigour vigour = VigourOf(primitive, theta);
    EXPECT_LE(vigour.rate_radps, 1.1 * carried.rate_radps) << primitive.name;
    EXPECT_LE(vigour.accel_mps2, 1.1 * carried.accel_mps2) << primitive.name;
  }
}

TEST(Primitives, HoldingStillHardlyMoves) {
  const Vigour still = VigourOf(Primitives().front(), HandheldRig("r").factory);
  EXPECT_LT(still.rate_radps, 0.02);
  EXPECT_LT(still.accel_mps2, 0.02);
}

// Forward is where the camera looks, however the IMU is mounted.
TEST(Primitives, AreDescribedFromTheCamera) {
  const Calibration theta = HandheldRig("r").factory;
  Calibration turned = theta;
  const Eigen::Quaterniond q_turn = Exp({0.3, -1.2, 2});
  turned.cameras[0].q_CI = theta.cameras[0].q_CI * q_turn;
  for (const Primitive& primitive : Primitives()) {
    const auto a = Perform(primitive, theta, kDuration_s, 3);
    const auto b = Perform(primitive, turned, kDuration_s, 3);
    for (const double t : {0.1, 1.7, 3.9}) {
      const BodyMotion in_a = a->At(t);
      const BodyMotion in_b = b->At(t);
      const Eigen::Quaterniond q_GC_a =
          in_a.q_GI * theta.cameras[0].q_CI.conjugate();
      const Eigen::Quaterniond q_GC_b =
          in_b.q_GI * turned.cameras[0].q_CI.conjugate();
      EXPECT_LT(q_GC_a.angularDistance(q_GC_b), 1e-6) << primitive.name;
      EXPECT_LT((in_a.p_GI - in_b.p_GI).norm(), 1e-9) << primitive.name;
    }
  }
}

TEST(Primitives, PanTurnsAboutTheVerticalAndNodDoesNot) {
  const Calibration theta = HandheldRig("r").factory;
  const auto about_vertical = [&](std::string_view name) {
    const auto trajectory =
        Perform(*FindPrimitive(name), theta, kDuration_s, 5);
    double vertical = 0, all = 0;
    for (double t = 0; t < kDuration_s; t += kStep_s) {
      const BodyMotion motion = trajectory->At(t);
      const Eigen::Vector3d w_G = motion.q_GI * motion.w_I;
      vertical += w_G.z() * w_G.z();
      all += w_G.squaredNorm();
    }
    return vertical / all;
  };
  EXPECT_GT(about_vertical("pan"), 0.9);
  EXPECT_LT(about_vertical("nod"), 0.1);
}

TEST(Primitives, AreTheSameForASeedAndDifferByIt) {
  const Calibration theta = HandheldRig("r").factory;
  for (const Primitive& primitive : Primitives()) {
    const auto a = Perform(primitive, theta, kDuration_s, 7);
    const auto again = Perform(primitive, theta, kDuration_s, 7);
    const auto other = Perform(primitive, theta, kDuration_s, 8);
    EXPECT_EQ(a->At(2).q_GI.coeffs(), again->At(2).q_GI.coeffs());
    EXPECT_EQ(a->At(2).p_GI, again->At(2).p_GI);
    EXPECT_NE(a->At(2).p_GI, other->At(2).p_GI);
  }
}

}  // namespace
}  // namespace selfcal
