// Equality of what two functions compute by the same formula. It is to the bit,
// but where the compiler contracts products and sums into one instruction
// (arm64): there each function rounds in its own way.
#pragma once

#include <gtest/gtest.h>

#include <Eigen/Core>

namespace selfcal {

template <typename A, typename B>
void ExpectSameFormula(const A& a, const B& b) {
#ifdef __FP_FAST_FMA
  constexpr double kRounding = 1e-12;
  ASSERT_EQ(a.size(), b.size());
  EXPECT_LE((a - b).norm(), kRounding * (1 + b.norm())) << a << " and " << b;
#else
  EXPECT_EQ(a, b);
#endif
}

}  // namespace selfcal
