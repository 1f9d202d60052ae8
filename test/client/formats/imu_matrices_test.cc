#include "client/formats/imu_matrices.h"

#include <gtest/gtest.h>

#include <Eigen/LU>

#include "client/formats/format_error.h"
#include "test/core/model/random_values.h"

namespace selfcal::client {
namespace {

using Eigen::Matrix3d;

Matrix3d RandomMatrix(RandomValues* random) {
  Matrix3d M = Matrix3d::Identity();
  M += 0.2 * Eigen::Map<const Matrix3d>(random->Vector(9, 1).data());
  return M * random->Rotation().toRotationMatrix();
}

TEST(Factors, AreTriangularPositiveAndARotation) {
  RandomValues random(1);
  for (int trial = 0; trial < 1000; ++trial) {
    const Matrix3d M = RandomMatrix(&random);
    const Factors lower = LowerFactors(M);
    const Factors upper = UpperFactors(M);
    EXPECT_TRUE(lower.triangular.isLowerTriangular(1e-15));
    EXPECT_TRUE(upper.triangular.isUpperTriangular(1e-15));
    for (const Factors& factors : {lower, upper}) {
      EXPECT_TRUE((factors.triangular * factors.R).isApprox(M, 1e-14));
      EXPECT_TRUE(factors.R.isUnitary(1e-14));
      EXPECT_GT(factors.R.determinant(), 0);
      EXPECT_GT(factors.triangular.diagonal().minCoeff(), 0);
    }
  }
}

TEST(Factors, AMirroredOrFlatMatrixIsAnError) {
  Matrix3d M = Matrix3d::Identity();
  M(1, 1) = -1;
  EXPECT_THROW(LowerFactors(M), FormatError);
  M(1, 1) = 0;
  EXPECT_THROW(UpperFactors(M), FormatError);
}

TEST(AccelFrame, ReadsTheSameAndTurnsBack) {
  RandomValues random(2);
  for (int trial = 0; trial < 1000; ++trial) {
    const ImuCalibration imu = random.Theta().imu;
    const AccelFrame body = ToAccelFrame(imu);
    EXPECT_TRUE(body.matrices.A.isLowerTriangular(1e-14));
    const Eigen::Vector3d v_I = random.Vector(3, 10);
    const Eigen::Vector3d v_B = body.R_BI * v_I;
    EXPECT_LT((body.matrices.G * v_B - imu.T_g() * v_I).norm(), 1e-13);
    EXPECT_LT((body.matrices.A * v_B - imu.T_a() * (imu.q_AI * v_I)).norm(),
              1e-13);
    const ImuInBody again = FromMatrices(body.matrices);
    EXPECT_TRUE(again.R_IB.isApprox(body.R_BI.transpose(), 1e-13));
    EXPECT_LT((again.imu.T_g() - imu.T_g()).norm(), 1e-13);
    EXPECT_LT((again.imu.T_a() - imu.T_a()).norm(), 1e-13);
    EXPECT_LT(again.imu.q_AI.angularDistance(imu.q_AI), 1e-7);
  }
}

}  // namespace
}  // namespace selfcal::client
