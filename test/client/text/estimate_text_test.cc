#include "client/text/estimate_text.h"

#include <gtest/gtest.h>

#include <numbers>

namespace selfcal::client {
namespace {

constexpr double kPi = std::numbers::pi;

v1::ComponentEstimate Rotation(double value, double from_factory) {
  v1::ComponentEstimate estimate;
  estimate.set_component("cam0.q_CI.x");
  estimate.set_unit("rad");
  estimate.set_value(value);
  estimate.set_from_factory(from_factory);
  estimate.set_sigma(0.001);
  return estimate;
}

// Near pi the vectors of two versions point to opposite sides.
TEST(Shown, RotationsNearPiDifferByWhatTheyDifferBy) {
  const ShownEstimate a = Shown(Rotation(kPi - 0.001, -0.0015));
  const ShownEstimate b = Shown(Rotation(-kPi + 0.002, 0.0015));
  EXPECT_NEAR(b.value - a.value, 0.003 * 180 / kPi, 1e-12);
  EXPECT_NEAR(a.sigma, 0.001 * 180 / kPi, 1e-12);
  EXPECT_EQ(a.unit, "deg from factory");
}

TEST(Shown, OtherComponentsAreTheirValues) {
  v1::ComponentEstimate estimate;
  estimate.set_unit("px");
  estimate.set_value(255.5);
  estimate.set_from_factory(1.5);
  estimate.set_sigma(0.2);
  const ShownEstimate shown = Shown(estimate);
  EXPECT_EQ(shown.value, 255.5);
  EXPECT_EQ(shown.sigma, 0.2);
  EXPECT_EQ(shown.unit, "px");
}

TEST(Shown, ARotationOfAnOlderDaemonIsItsVector) {
  v1::ComponentEstimate estimate = Rotation(0.5, 0);
  estimate.clear_from_factory();
  EXPECT_EQ(Shown(estimate).value, 0.5);
  EXPECT_EQ(Shown(estimate).unit, "rad");
}

TEST(Shown, DifferencesOfRotationsAreInDegreesFromTheFactorys) {
  v1::CompareCalibrationsResponse::Difference difference;
  difference.set_unit("rad");
  difference.set_value_a(kPi - 0.001);
  difference.set_value_b(-kPi + 0.002);
  difference.set_from_factory_a(-0.0015);
  difference.set_from_factory_b(0.0015);
  difference.set_difference(0.003);
  difference.set_sigma(0.001);
  const ShownDifference shown = Shown(difference);
  EXPECT_NEAR(shown.b - shown.a, shown.difference, 1e-12);
  EXPECT_NEAR(shown.difference, 0.003 * 180 / kPi, 1e-12);
  EXPECT_NEAR(shown.sigma, 0.001 * 180 / kPi, 1e-12);
}

TEST(VerdictText, OfAnOlderDaemonIsUnknown) {
  v1::Calibration calibration;
  EXPECT_EQ(VerdictText(calibration), "unknown");
  calibration.mutable_verdict()->set_text("not trustworthy");
  EXPECT_EQ(VerdictText(calibration), "not trustworthy");
}

}  // namespace
}  // namespace selfcal::client
