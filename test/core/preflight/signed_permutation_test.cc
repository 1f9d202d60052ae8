#include "core/preflight/signed_permutation.h"

#include <gtest/gtest.h>

#include <Eigen/LU>

namespace selfcal {
namespace {

TEST(SignedPermutations, AreAllThereAreAndBeginWithTheIdentity) {
  const auto& all = SignedPermutations();
  EXPECT_TRUE(all[0].isIdentity());
  int proper = 0;
  for (std::size_t i = 0; i < all.size(); ++i) {
    EXPECT_TRUE((all[i] * all[i].transpose()).isIdentity());
    proper += all[i].determinant() > 0;
    for (std::size_t j = 0; j < i; ++j) EXPECT_NE(all[i], all[j]);
  }
  EXPECT_EQ(proper, 24);
}

TEST(SignedPermutations, AreWrittenAsWhatToSend) {
  Eigen::Matrix3d m;
  m << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  EXPECT_EQ(AxesText(m), "(-y, x, z)");
  EXPECT_EQ(AxesText(-Eigen::Matrix3d::Identity()), "(-x, -y, -z)");
}

}  // namespace
}  // namespace selfcal
