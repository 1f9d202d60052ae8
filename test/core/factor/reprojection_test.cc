#include "core/factor/reprojection.h"

#include <gtest/gtest.h>

#include <cmath>
#include <optional>

#include "test/core/factor/random_values.h"
#include "test/core/model/each_model.h"
#include "test/core/model/rounding.h"
#include "test/core/numeric_jacobian.h"

namespace selfcal {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::Vector4d;
using Eigen::VectorXd;

constexpr double kStep = 1e-4;
constexpr double kTolerance = 1e-8;

struct View {
  Quaterniond q_GI;
  Vector3d p_GI;
  CameraCalibration camera;
  Vector4d landmark_G;
  Vector2d z_px;
  std::optional<KeyframeMotion> motion;

  const KeyframeMotion* Motion() const { return motion ? &*motion : nullptr; }
};

// The homogeneous landmark that this view observes in the given direction of
// the camera, at 1 / w metres.
Vector4d LandmarkAt(const View& view, const Vector3d& bearing_C, double w) {
  const Vector3d p_I =
      view.camera.q_CI.conjugate() * (bearing_C - w * view.camera.p_CI);
  const ExposurePose pose =
      view.motion
          ? MovePose(view.q_GI, view.p_GI, *view.motion, view.camera, view.z_px)
          : PoseAtRest(view.q_GI, view.p_GI);
  Vector4d landmark;
  landmark << pose.q_GI * p_I + w * pose.p_GI, w;
  return landmark;
}

View RandomView(RandomValues& random, DistortionModel model) {
  View view;
  view.q_GI = random.Rotation();
  view.p_GI = random.Normal3(5);
  view.camera = random.Camera(model);
  view.camera.time_offset_s = random.Uniform(-0.03, 0.03);
  view.z_px = {random.Uniform(0, 640), random.Uniform(0, 480)};
  return view;
}

// Returns true if the pixel is far enough from the border of the region of its
// model for differences, which move the border as well.
bool HasRoom(const View& view) {
  const Vector2d further_px = 1.1 * (view.z_px - view.camera.c) + view.camera.c;
  for (const double shift : {-1e-3, 0.0, 1e-3}) {
    CameraCalibration camera = view.camera;
    camera.distortion.array() += shift;
    Vector3d bearing_C;
    if (!Unproject(camera, further_px, &bearing_C)) return false;
  }
  return true;
}

// Moves one argument of the view by its part of the delta, and evaluates.
enum class Argument { kPose, kCamera, kLandmark };

VectorXd ResidualAt(const View& view,
                    Argument argument,
                    const VectorXd& delta) {
  View moved = view;
  if (argument == Argument::kPose) {
    moved.q_GI = view.q_GI * Exp(delta.head<3>());
    moved.p_GI += delta.tail<3>();
  } else if (argument == Argument::kCamera) {
    VectorXd theta_delta(kImuTangentSize + delta.size());
    theta_delta << VectorXd::Zero(kImuTangentSize), delta;
    moved.camera =
        BoxPlus(Calibration{.imu = {}, .cameras = {view.camera}}, theta_delta)
            .cameras.front();
  } else {
    moved.landmark_G += delta;
  }
  Vector2d residual;
  EXPECT_TRUE(Reproject(moved.q_GI,
                        moved.p_GI,
                        moved.camera,
                        moved.landmark_G,
                        moved.z_px,
                        &residual,
                        nullptr,
                        moved.Motion()));
  return residual;
}

void ExpectJacobiansMatch(const View& view) {
  Vector2d residual;
  ReprojectionJacobians J;
  ASSERT_TRUE(Reproject(view.q_GI,
                        view.p_GI,
                        view.camera,
                        view.landmark_G,
                        view.z_px,
                        &residual,
                        &J,
                        view.Motion()));
  ExpectSameFormula(ResidualAt(view, Argument::kLandmark, Vector4d::Zero()),
                    residual);
  const auto numeric = [&](Argument argument, const VectorXd& unit) {
    return NumericJacobian(
        [&](const VectorXd& delta) {
          return ResidualAt(view, argument, unit.cwiseProduct(delta));
        },
        static_cast<int>(unit.size()),
        kStep);
  };
  const int camera_size = CameraTangentSize(view.camera);
  ASSERT_EQ(J.camera.cols(), camera_size);
  // Hundreds of rows multiply a step of the line delay, and hundreds of seconds
  // one of the drift.
  VectorXd camera_unit = VectorXd::Ones(camera_size);
  const int optional =
      (view.camera.line_delay_s ? 1 : 0) + (view.camera.time_drift ? 1 : 0);
  camera_unit.tail(optional).setConstant(2e-3);
  EXPECT_LT(
      RowwiseDifference(J.pose, numeric(Argument::kPose, VectorXd::Ones(6))),
      kTolerance);
  EXPECT_LT(RowwiseDifference(J.camera * camera_unit.asDiagonal(),
                              numeric(Argument::kCamera, camera_unit)),
            kTolerance);
  EXPECT_LT(RowwiseDifference(J.landmark,
                              numeric(Argument::kLandmark, VectorXd::Ones(4))),
            kTolerance);
}

class ReprojectionOfEachModel : public testing::TestWithParam<DistortionModel> {
};

INSTANTIATE_TEST_SUITE_P(Models,
                         ReprojectionOfEachModel,
                         EachCameraModel(),
                         CameraModelName);

TEST_P(ReprojectionOfEachModel, ObservesALandmarkWhereItsPointProjects) {
  RandomValues random(1);
  for (int trial = 0; trial < 1000; ++trial) {
    const View view = RandomView(random, GetParam());
    const Vector3d p_C(random.Uniform(-1, 1), random.Uniform(-1, 1), 2);
    Vector2d direct_px;
    if (!Project(view.camera, p_C, &direct_px, nullptr)) continue;
    const Vector3d p_G =
        view.q_GI * (view.camera.q_CI.conjugate() * (p_C - view.camera.p_CI)) +
        view.p_GI;
    const double scale = random.LogUniform(1e-3, 1e3);
    Vector2d residual;
    ASSERT_TRUE(Reproject(view.q_GI,
                          view.p_GI,
                          view.camera,
                          scale * p_G.homogeneous(),
                          view.z_px,
                          &residual,
                          nullptr));
    EXPECT_LT((residual - (direct_px - view.z_px)).norm(), 1e-9);
  }
}

TEST_P(ReprojectionOfEachModel, JacobiansMatchDifferencesAtRandomStates) {
  RandomValues random(2);
  int seen = 0;
  for (int trial = 0; trial < 1500; ++trial) {
    View view = RandomView(random, GetParam());
    if (trial % 2 == 0) view.motion = random.Motion();
    if (trial % 3 == 0) view.camera.line_delay_s = 1e-5 * (trial % 13 - 6);
    if (trial % 5 < 2) view.camera.time_drift = 1e-5 * (trial % 7 - 3);
    if (view.motion) view.motion->session_s = trial % 300;
    Vector3d bearing_C;
    if (!HasRoom(view) || !Unproject(view.camera, view.z_px, &bearing_C)) {
      continue;
    }
    // From half a metre to beyond the range of parallax, and infinity.
    const double w = trial % 10 == 0 ? 0 : random.LogUniform(1e-6, 2);
    view.landmark_G = LandmarkAt(view, bearing_C, w);
    view.z_px += Vector2d(random.NormalVector(2));
    ExpectJacobiansMatch(view);
    if (HasFatalFailure()) return;
    ++seen;
  }
  EXPECT_GT(seen, 1200);
}

TEST_P(ReprojectionOfEachModel, JacobiansMatchDifferencesNearTheAxis) {
  RandomValues random(3);
  for (int trial = 0; trial < 500; ++trial) {
    View view = RandomView(random, GetParam());
    const double off = trial % 5 == 0 ? 0 : random.LogUniform(1e-12, 1e-2);
    const Vector3d bearing_C =
        Vector3d(off * random.Normal(), off * random.Normal(), 1).normalized();
    view.landmark_G = LandmarkAt(view, bearing_C, random.Uniform(0, 2));
    ExpectJacobiansMatch(view);
    if (HasFatalFailure()) return;
  }
}

TEST(Reprojection, JacobiansMatchDifferencesWhereFovDistortionVanishes) {
  RandomValues random(4);
  for (int trial = 0; trial < 1000; ++trial) {
    View view = RandomView(random, DistortionModel::kFov);
    const double w = trial % 10 == 0 ? 0 : random.LogUniform(1e-9, 0.1);
    view.camera.distortion[0] = trial % 2 == 0 ? w : -w;
    Vector3d bearing_C;
    if (!Unproject(view.camera, view.z_px, &bearing_C)) continue;
    view.landmark_G = LandmarkAt(view, bearing_C, random.LogUniform(1e-6, 2));
    ExpectJacobiansMatch(view);
    if (HasFatalFailure()) return;
  }
}

TEST_P(ReprojectionOfEachModel, WithAMotionIsThatOfTheMovedPose) {
  RandomValues random(6);
  for (int trial = 0; trial < 200; ++trial) {
    View view = RandomView(random, GetParam());
    view.motion = random.Motion();
    if (trial % 3 == 0) view.camera.line_delay_s = 1e-5 * (trial % 13 - 6);
    view.landmark_G = LandmarkAt(view, {0.1, -0.2, 1}, random.Uniform(0, 2));
    const ExposurePose pose =
        MovePose(view.q_GI, view.p_GI, *view.motion, view.camera, view.z_px);
    Vector2d moved, there;
    const auto at = [&](const Quaterniond& q_GI,
                        const Vector3d& p_GI,
                        const KeyframeMotion* motion,
                        Vector2d* residual) {
      return Reproject(q_GI,
                       p_GI,
                       view.camera,
                       view.landmark_G,
                       view.z_px,
                       residual,
                       nullptr,
                       motion);
    };
    ASSERT_TRUE(at(view.q_GI, view.p_GI, view.Motion(), &moved));
    ASSERT_TRUE(at(pose.q_GI, pose.p_GI, nullptr, &there));
    EXPECT_LT((moved - there).norm(), 1e-9);
  }
}

TEST_P(ReprojectionOfEachModel, ARejectedPointLeavesTheOutputsUntouched) {
  RandomValues random(5);
  for (int trial = 0; trial < 200; ++trial) {
    View view = RandomView(random, GetParam());
    // No model sees the backward axis.
    view.landmark_G =
        LandmarkAt(view, -Vector3d::UnitZ(), random.Uniform(0, 2));
    Vector2d residual(1, 2);
    ReprojectionJacobians J;
    J.pose.setConstant(3);
    J.camera.setConstant(2, 5, 4);
    J.landmark.setConstant(5);
    EXPECT_FALSE(Reproject(view.q_GI,
                           view.p_GI,
                           view.camera,
                           view.landmark_G,
                           view.z_px,
                           &residual,
                           &J));
    EXPECT_EQ(residual, Vector2d(1, 2));
    EXPECT_TRUE((J.pose.array() == 3).all());
    EXPECT_EQ(J.camera.cols(), 5);
    EXPECT_TRUE((J.camera.array() == 4).all());
    EXPECT_TRUE((J.landmark.array() == 5).all());
  }
}

}  // namespace
}  // namespace selfcal
