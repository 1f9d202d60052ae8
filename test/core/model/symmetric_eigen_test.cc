#include "core/model/symmetric_eigen.h"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>

namespace selfcal {
namespace {

TEST(SymmetricEigen, HasTheRootsOfTheCharacteristicPolynomial) {
  // (a - x)(c - x) - b^2 = 0
  const double a = 5, b = 2, c = 2;
  const double half = std::sqrt((a - c) * (a - c) / 4 + b * b);
  const Eigen::MatrixXd matrix{{a, b}, {b, c}};
  const SymmetricEigen eigen(matrix);
  EXPECT_NEAR(eigen.eigenvalues()(0), (a + c) / 2 - half, 1e-14);
  EXPECT_NEAR(eigen.eigenvalues()(1), (a + c) / 2 + half, 1e-14);
}

TEST(SymmetricEigen, DecomposesMatricesOfAllSizes) {
  for (int size = 1; size <= 40; ++size) {
    const Eigen::MatrixXd root = Eigen::MatrixXd::Random(size, size);
    const Eigen::MatrixXd matrix = root + root.transpose();
    const SymmetricEigen eigen(matrix);
    const Eigen::MatrixXd& V = eigen.eigenvectors();
    EXPECT_LT((matrix * V - V * eigen.eigenvalues().asDiagonal()).norm(),
              1e-13 * size * matrix.norm());
    EXPECT_LT(
        (V.transpose() * V - Eigen::MatrixXd::Identity(size, size)).norm(),
        1e-13 * size);
    for (int i = 1; i < size; ++i) {
      EXPECT_LE(eigen.eigenvalues()(i - 1), eigen.eigenvalues()(i));
    }
    EXPECT_LT((SymmetricEigenvalues(matrix) - eigen.eigenvalues()).norm(),
              1e-13 * size * matrix.norm());
  }
}

TEST(SymmetricEigen, ReadsTheLowerTriangleAlone) {
  const Eigen::MatrixXd symmetric{{2, 1}, {1, 3}};
  const Eigen::MatrixXd lower{{2, std::nan("")}, {1, 3}};
  EXPECT_EQ(SymmetricEigenvalues(lower), SymmetricEigenvalues(symmetric));
  EXPECT_EQ(SymmetricEigen(lower).eigenvectors(),
            SymmetricEigen(symmetric).eigenvectors());
}

}  // namespace
}  // namespace selfcal
