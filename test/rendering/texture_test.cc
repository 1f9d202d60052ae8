#include "test/rendering/texture.h"

#include <gtest/gtest.h>

#include <cmath>

namespace selfcal {
namespace {

// Mean and standard deviation of the texture over a grid, at one level.
struct Contrast {
  double mean = 0;
  double sigma = 0;
};
Contrast ContrastOf(const Texture& texture, int level) {
  constexpr int kSteps = 512;
  double sum = 0;
  double squares = 0;
  for (int i = 0; i < kSteps; ++i) {
    for (int j = 0; j < kSteps; ++j) {
      const double value = texture.At(8.3F * static_cast<float>(i) + 1,
                                      8.3F * static_cast<float>(j) + 1,
                                      level);
      sum += value;
      squares += value * value;
    }
  }
  const double mean = sum / (kSteps * kSteps);
  return {mean, std::sqrt(squares / (kSteps * kSteps) - mean * mean)};
}

TEST(Texture, ReturnsTheValueOfATexelAtItsCentre) {
  const Texture texture(1, 1, {10, 20, 30, 40});
  EXPECT_EQ(texture.At(2.5F, 2.5F, 0), 10);
  EXPECT_EQ(texture.At(3.5F, 2.5F, 0), 20);
  EXPECT_EQ(texture.At(2.5F, 3.5F, 0), 30);
  EXPECT_EQ(texture.At(3.5F, 3.5F, 0), 40);
}

TEST(Texture, InterpolatesLinearlyAndRepeats) {
  const Texture texture(1, 1, {10, 20, 30, 40});
  EXPECT_FLOAT_EQ(texture.At(2.75F, 2.5F, 0), 12.5F);
  EXPECT_FLOAT_EQ(texture.At(3, 3, 0), 25);
  // This is between the last column and the first one of the next period.
  EXPECT_FLOAT_EQ(texture.At(4, 2.5F, 0), 15);
  EXPECT_FLOAT_EQ(texture.At(2.9F, 3.2F, 0), texture.At(8.9F, 11.2F, 0));
}

TEST(Texture, LevelsAreMeansOfFourTexels) {
  const Texture texture(1, 1, {10, 20, 30, 40});
  ASSERT_EQ(texture.levels(), 2);
  EXPECT_EQ(texture.At(3, 3, 1), 25);
}

TEST(Texture, LeavesKeepTheirMeanAndLoseContrastWithTheLevel) {
  const Texture texture = MakeLeafTexture(1);
  const Contrast fine = ContrastOf(texture, 0);
  EXPECT_GT(fine.sigma, 40);
  double sigma = fine.sigma;
  for (int level = 2; level < 10; level += 2) {
    const Contrast coarse = ContrastOf(texture, level);
    EXPECT_NEAR(coarse.mean, fine.mean, 3) << level;
    EXPECT_LT(coarse.sigma, sigma) << level;
    sigma = coarse.sigma;
  }
  // Leaves of every size up to 1.2 m: some contrast is left at 64 cm.
  EXPECT_GT(ContrastOf(texture, 6).sigma, 5);
}

TEST(Texture, NeighbouringTexelsOfLeavesDifferByLittleMoreThanHalfAnEdge) {
  // The finest texels are smoothed with weights 1, 2, 1: a step from the
  // darkest to the brightest grey takes three of them.
  const Texture texture = MakeLeafTexture(2);
  float largest = 0;
  for (int i = 1; i < 2000; ++i) {
    for (int j = 1; j < 400; ++j) {
      const float u = static_cast<float>(i) + 0.5F;
      const float v = static_cast<float>(j) + 0.5F;
      largest = std::max(
          largest, std::abs(texture.At(u + 1, v, 0) - texture.At(u, v, 0)));
    }
  }
  EXPECT_GT(largest, 40);
  EXPECT_LE(largest, 0.5 * 215 + 1.5);
}

TEST(Texture, FollowsFromTheSeed) {
  const Texture a = MakeLeafTexture(1);
  const Texture b = MakeLeafTexture(1);
  const Texture c = MakeLeafTexture(2);
  int differences = 0;
  for (int i = 0; i < 1000; ++i) {
    const float u = 4.1F * static_cast<float>(i) + 1;
    ASSERT_EQ(a.At(u, 100, 0), b.At(u, 100, 0));
    if (a.At(u, 100, 0) != c.At(u, 100, 0)) ++differences;
  }
  EXPECT_GT(differences, 900);
}

}  // namespace
}  // namespace selfcal
