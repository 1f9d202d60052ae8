#include "core/simulation/envelope.h"

#include <gtest/gtest.h>

#include "core/simulation/random.h"

namespace selfcal {
namespace {

Envelope Steps() {
  Envelope envelope(0);
  envelope.Hold(3);
  envelope.MoveTo(1, 2);
  envelope.Hold(4);
  envelope.MoveTo(0.05, 1.5);
  return envelope;
}

TEST(EnvelopeTest, HoldsItsLevelsAndMovesBetweenThem) {
  const Envelope envelope = Steps();
  EXPECT_DOUBLE_EQ(envelope.end_s(), 10.5);
  EXPECT_EQ(envelope.At(0).value, 0);
  EXPECT_EQ(envelope.At(2.9).value, 0);
  EXPECT_DOUBLE_EQ(envelope.At(4).value, 0.5);
  EXPECT_DOUBLE_EQ(envelope.At(7).value, 1);
  EXPECT_DOUBLE_EQ(envelope.At(50).value, 0.05);
  EXPECT_EQ(envelope.At(50).d1, 0);
}

TEST(EnvelopeTest, DerivativesAndIntegralBelongToTheValue) {
  const Envelope envelope = Steps();
  Random random(1, 0);
  constexpr double h = 1e-5;
  for (int i = 0; i < 1000; ++i) {
    const double t = random.Uniform(h, 14);
    const auto before = envelope.At(t - h);
    const auto at = envelope.At(t);
    const auto after = envelope.At(t + h);
    EXPECT_NEAR(at.d1, (after.value - before.value) / (2 * h), 1e-8);
    EXPECT_NEAR(at.d2, (after.d1 - before.d1) / (2 * h), 2e-4);
    EXPECT_NEAR(at.value, (after.integral - before.integral) / (2 * h), 1e-8);
  }
}

TEST(EnvelopeTest, SecondDerivativeIsContinuousWherePiecesMeet) {
  const Envelope envelope = Steps();
  for (const double t : {3.0, 5.0, 9.0, 10.5}) {
    EXPECT_NEAR(envelope.At(t - 1e-9).d2, envelope.At(t + 1e-9).d2, 1e-6);
    EXPECT_NEAR(envelope.At(t - 1e-9).d1, envelope.At(t + 1e-9).d1, 1e-8);
    EXPECT_NEAR(
        envelope.At(t - 1e-9).integral, envelope.At(t + 1e-9).integral, 1e-8);
  }
}

}  // namespace
}  // namespace selfcal
