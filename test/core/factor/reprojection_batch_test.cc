// Compares the kernels with the plain function, for every width of this
// machine.
#include "core/factor/reprojection_batch.h"

#include <gtest/gtest.h>

#include <optional>
#include <vector>

#include "core/factor/reprojection.h"
#include "test/core/factor/random_values.h"

namespace selfcal {
namespace {

constexpr double kSigma_px = 0.8;
// Relative; the kernels use fused multiply-add and a separate arc tangent.
constexpr double kBatchTolerance = 1e-12;

std::vector<VectorWidth> Widths() {
  std::vector<VectorWidth> widths;
  for (const VectorWidth width :
       {VectorWidth::k2, VectorWidth::k4, VectorWidth::k8}) {
    if (HasVectors(width)) widths.push_back(width);
  }
  return widths;
}

// Points in front of a camera and some behind it, in random order.
struct BatchScene {
  KeyframeState keyframe;
  CameraCalibration camera;
  std::vector<double> points;
  std::vector<std::int32_t> landmarks;
  std::vector<double> z_px;
  std::optional<KeyframeMotion> motion;

  const KeyframeMotion* Motion() const { return motion ? &*motion : nullptr; }
  ObservationRun Run() const {
    return {&keyframe,
            &camera,
            static_cast<int>(landmarks.size()),
            landmarks.data(),
            z_px.data(),
            Motion()};
  }
  Eigen::Vector4d Point(int observation) const {
    return Eigen::Vector4d::Map(&points[4 * landmarks[observation]]);
  }
};

BatchScene RandomScene(RandomValues& random,
                       DistortionModel model,
                       int count,
                       bool moves,
                       bool rolling,
                       bool drifts) {
  BatchScene scene;
  scene.keyframe.q_GI = random.Rotation();
  scene.keyframe.p_GI = random.Normal3(5);
  scene.camera = random.Camera(model);
  scene.camera.time_offset_s = random.Uniform(-0.03, 0.03);
  if (moves) scene.motion = random.Motion();
  if (rolling) scene.camera.line_delay_s = moves ? 6e-5 : -4e-5;
  if (drifts) scene.camera.time_drift = random.Uniform(-1e-4, 1e-4);
  if (drifts && moves) scene.motion->session_s = random.Uniform(0, 100);
  for (int i = 0; i < count; ++i) {
    const double depth = random.Uniform(0, 1) < 0.1 ? -1 : random.Uniform(1, 9);
    const Eigen::Vector3d p_C(depth * random.Uniform(-0.7, 0.7),
                              depth * random.Uniform(-0.7, 0.7),
                              depth);
    const Eigen::Vector3d p_I =
        scene.camera.q_CI.conjugate() * (p_C - scene.camera.p_CI);
    const Eigen::Vector3d p_G = scene.keyframe.q_GI * p_I + scene.keyframe.p_GI;
    // Any positive scale; infinity is 1e6 m away.
    const double w = random.LogUniform(1e-6, 10);
    const Eigen::Vector4d point = w * p_G.homogeneous();
    scene.points.insert(scene.points.end(), point.data(), point.data() + 4);
    scene.landmarks.push_back(count - 1 - i);
    scene.z_px.push_back(random.Uniform(0, 640));
    scene.z_px.push_back(random.Uniform(0, 480));
  }
  return scene;
}

// Calls check(scene, batch) for all models, widths and lengths of a run.
template <typename Check>
void ForRandomScenes(unsigned seed, const Check& check) {
  RandomValues random(seed);
  for (const DistortionModel model : DistortionModels()) {
    for (const int count : {1, 2, 3, 7, 8, 9, 50}) {
      for (int kind = 0; kind < 8; ++kind) {
        const BatchScene scene = RandomScene(random,
                                             model,
                                             count,
                                             (kind & 1) != 0,
                                             (kind & 2) != 0,
                                             (kind & 4) != 0);
        for (const VectorWidth width : Widths()) {
          SCOPED_TRACE(VectorWidthName(width));
          check(scene, ReprojectionBatch(width), random);
        }
      }
    }
  }
}

bool Evaluate(const BatchScene& scene,
              int i,
              Eigen::Vector2d* r,
              ReprojectionJacobians* J) {
  return Reproject(scene.keyframe.q_GI,
                   scene.keyframe.p_GI,
                   scene.camera,
                   scene.Point(i),
                   Eigen::Vector2d(scene.z_px[2 * i], scene.z_px[2 * i + 1]),
                   r,
                   J,
                   scene.Motion());
}

TEST(ReprojectionBatch, RowsAreThoseOfThePlainFunction) {
  int behind = 0;
  ForRandomScenes(
      1, [&](const BatchScene& scene, const auto& batch, auto& random) {
        const ObservationRun run = scene.Run();
        const auto turn = PoseTurn(run);
        EXPECT_EQ(turn.has_value(), scene.motion.has_value());
        const LandmarkRows columns = RowsOf(scene.camera);
        const int stride = columns.stride();
        std::vector<double> weights(run.count);
        for (double& weight : weights) weight = random.Uniform(0, 2);
        for (const bool weighted : {false, true}) {
          std::vector<double> rows(2 * (run.count + 7) * stride, 7.0);
          batch.Linearise(run,
                          scene.points.data(),
                          kSigma_px,
                          weighted ? weights.data() : nullptr,
                          rows.data());
          for (int i = 0; i < run.count; ++i) {
            Eigen::MatrixXd expected = Eigen::MatrixXd::Zero(2, stride);
            Eigen::Vector2d r(0, 0);
            ReprojectionJacobians J;
            if (Evaluate(scene, i, &r, &J)) {
              // The rows of a rolling shutter have the derivative with respect
              // to the rotation of one pose of all rows, from which that of the
              // keyframe follows; the rotation of the camera acts at another.
              Eigen::Matrix<double, 2, 6> by_exposure;
              by_exposure << -J.camera.leftCols(3), J.pose.rightCols(3);
              if (columns.rolling) {
                by_exposure.leftCols<3>() = J.pose.leftCols<3>();
              }
              if (columns.rolling && turn) {
                by_exposure.leftCols<3>() -=
                    J.pose.rightCols<3>() * turn->bottomRows<3>();
                by_exposure.leftCols<3>() *= turn->topRows<3>().transpose();
              }
              expected.leftCols(6) = by_exposure;
              expected.middleCols(kRowsOwn, columns.own()) =
                  J.camera.rightCols(columns.own());
              for (int row = 0; row < 2; ++row) {
                expected(row, columns.residual()) = r[row];
              }
              expected *= weighted ? weights[i] : 1 / kSigma_px;
              const Eigen::MatrixXd by_turn =
                  turn ? Eigen::MatrixXd(by_exposure * *turn)
                       : Eigen::MatrixXd(by_exposure.leftCols(3));
              EXPECT_LE((J.pose.leftCols(3) - by_turn).norm(),
                        kBatchTolerance * by_turn.norm());
              // The point is p_G = X / w.
              const Eigen::MatrixXd by_p_G =
                  scene.Point(i)[3] * J.landmark.leftCols(3);
              EXPECT_LE((by_p_G + J.pose.rightCols(3)).norm(),
                        kBatchTolerance * by_p_G.norm());
            } else {
              ++behind;
            }
            const Eigen::Map<
                const Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::RowMajor>>
                actual(&rows[2 * i * stride], 2, stride);
            EXPECT_LE((actual - expected).norm(),
                      kBatchTolerance * expected.norm());
          }
        }
      });
  EXPECT_GT(behind, 50);
}

TEST(ReprojectionBatch, SumsOfLandmarksAreThoseOfTheHuberLoss) {
  constexpr double kHuber = 2;
  ForRandomScenes(2, [&](const BatchScene& scene, const auto& batch, auto&) {
    const ObservationRun run = scene.Run();
    std::vector<LandmarkSums> sums(run.count);
    std::vector<double> squares(run.count), again(run.count);
    batch.AddLandmarkSums(run,
                          scene.points.data(),
                          kSigma_px,
                          kHuber,
                          squares.data(),
                          sums.data());
    batch.Squares(run, scene.points.data(), again.data());
    for (int i = 0; i < run.count; ++i) {
      const LandmarkSums& sum = sums[run.landmarks[i]];
      Eigen::Vector2d r(0, 0);
      ReprojectionJacobians J;
      if (!Evaluate(scene, i, &r, &J)) {
        EXPECT_EQ(squares[i], -1);
        EXPECT_EQ(again[i], -1);
        for (const double value : sum.values) EXPECT_EQ(value, 0);
        continue;
      }
      EXPECT_NEAR(
          squares[i], r.squaredNorm(), kBatchTolerance * r.squaredNorm());
      EXPECT_NEAR(again[i], r.squaredNorm(), kBatchTolerance * r.squaredNorm());
      const Eigen::Matrix<double, 2, 3> J_l =
          J.landmark.leftCols<3>() / kSigma_px;
      const double e = r.norm() / kSigma_px;
      const double weight = e > kHuber ? kHuber / e : 1;
      const Eigen::Matrix3d H = weight * J_l.transpose() * J_l;
      const Eigen::Vector3d g = weight / kSigma_px * J_l.transpose() * r;
      for (int a = 0; a < 3; ++a) {
        EXPECT_NEAR(sum.g(a), g(a), kBatchTolerance * g.norm());
        for (int b = 0; b <= a; ++b) {
          EXPECT_NEAR(sum.H(a, b), H(a, b), kBatchTolerance * H.norm());
        }
      }
      const double cost = e > kHuber ? kHuber * (2 * e - kHuber) : e * e;
      EXPECT_NEAR(sum.cost(), cost, kBatchTolerance * cost);
      EXPECT_EQ(sum.projected(), 1);
    }
  });
}

}  // namespace
}  // namespace selfcal
