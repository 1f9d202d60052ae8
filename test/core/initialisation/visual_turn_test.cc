#include "core/initialisation/visual_turn.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/model/so3.h"
#include "test/core/model/random_values.h"

namespace selfcal {
namespace {

TEST(RotationOfMoments, IsTheRotationOfVectorsAlsoInAPlane) {
  RandomValues random(1);
  for (int n = 0; n < 100; ++n) {
    const Eigen::Quaterniond q_BA = random.Rotation();
    Eigen::Matrix3d moments = Eigen::Matrix3d::Zero();
    for (int i = 0; i < 10; ++i) {
      Eigen::Vector3d a = random.Direction();
      if (n % 2 == 0) a.z() = 0;
      moments += random.Uniform(0.1, 1) * (q_BA * a) * a.transpose();
    }
    EXPECT_LT(Log(RotationOfMoments(moments).conjugate() * q_BA).norm(), 1e-12);
  }
}

TEST(RotationOfDistantPoints, IsNotMovedByOutliers) {
  RandomValues random(2);
  for (int n = 0; n < 100; ++n) {
    // 3 rad/s at 20 Hz.
    const Eigen::Quaterniond q_BA = Exp(0.15 * random.Direction());
    std::vector<RayPair> pairs;
    for (int i = 0; i < 100; ++i) {
      const auto ray = [&] {
        return Eigen::Vector3d(
                   random.Uniform(-1, 1), random.Uniform(-0.8, 0.8), 1)
            .normalized();
      };
      const Eigen::Vector3d a = ray();
      // A third are anywhere; the others have noise of half a pixel.
      const Eigen::Vector3d b =
          i % 3 == 0 ? ray() : q_BA * a + random.Vector(3, 2e-3);
      pairs.push_back({a, b.normalized()});
    }
    EXPECT_LT(Log(RotationOfDistantPoints(pairs).conjugate() * q_BA).norm(),
              1.5e-3)
        << n;
  }
}

}  // namespace
}  // namespace selfcal
