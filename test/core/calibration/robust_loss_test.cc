#include "core/calibration/robust_loss.h"

#include <gtest/gtest.h>

#include <cmath>

namespace selfcal {
namespace {

const RobustLoss kLosses[] = {{LossKind::kNone, 2, 6},
                              {LossKind::kHuber, 2, 6},
                              {LossKind::kCauchy, 2, 6},
                              {LossKind::kHuber, 1, 10}};

TEST(RobustLoss, WeightIsTheDerivativeOfTheValue) {
  for (const RobustLoss& loss : kLosses) {
    for (double s = 0.05; s < 150; s *= 1.07) {
      const double h = 1e-5 * s;
      const double slope = (loss.Value(s + h) - loss.Value(s - h)) / (2 * h);
      EXPECT_NEAR(slope, loss.Weight(s), 1e-4) << "s = " << s;
    }
  }
}

TEST(RobustLoss, CurvatureIsTheDerivativeOfTheGradient) {
  for (const RobustLoss& loss : kLosses) {
    const double corners[] = {std::pow(loss.scale, 2),
                              std::pow(0.6 * loss.gate, 2),
                              std::pow(loss.gate, 2)};
    for (double s = 0.05; s < 150; s *= 1.07) {
      const double h = 1e-5 * s;
      bool at_corner = false;
      for (const double corner : corners) {
        at_corner = at_corner || std::abs(s - corner) < 2 * h;
      }
      if (at_corner) continue;
      const double slope =
          ((s + h) * loss.Weight(s + h) - (s - h) * loss.Weight(s - h)) /
          (2 * h);
      EXPECT_NEAR(slope, loss.Curvature(s), 1e-4) << "s = " << s;
    }
  }
}

TEST(RobustLoss, SmallResidualsHaveFullWeight) {
  for (const RobustLoss& loss : kLosses) {
    EXPECT_NEAR(loss.Weight(1e-9), 1, 1e-8);
    EXPECT_NEAR(loss.Value(1e-9), 1e-9, 1e-17);
  }
}

TEST(RobustLoss, WeightNeverRisesAndIsZeroFromTheGateOn) {
  for (const RobustLoss& loss : kLosses) {
    double last = 1;
    for (double s = 0; s < 150; s += 0.1) {
      const double weight = loss.Weight(s);
      EXPECT_LE(weight, last + 1e-12);
      EXPECT_GE(weight, 0);
      last = weight;
    }
    const double gate2 = loss.gate * loss.gate;
    EXPECT_NEAR(loss.Weight(gate2 * (1 - 1e-9)), 0, 1e-6);
    EXPECT_EQ(loss.Weight(gate2 * 1.01), 0);
    EXPECT_NEAR(loss.Value(4 * gate2), loss.Value(gate2), 1e-9);
  }
}

}  // namespace
}  // namespace selfcal
