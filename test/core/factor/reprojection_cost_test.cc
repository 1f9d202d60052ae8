#include <gtest/gtest.h>

#include <optional>

#include "core/factor/ceres_factors.h"
#include "test/core/factor/cost_function_checks.h"
#include "test/core/factor/random_values.h"

namespace selfcal {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::Vector4d;
using Eigen::VectorXd;

constexpr double kSigma = 0.8;
constexpr double kStep = 1e-4;
constexpr double kCostTolerance = 1e-8;

// A rig with one camera of each model, and an observation of one of them.
struct View {
  Calibration reference;
  int camera;
  Quaterniond q_GI;
  Vector3d p_GI;
  Vector3d p_G;  // of the landmark
  Vector2d z_px;
  VectorXd delta;  // of theta, from the reference
  std::optional<KeyframeMotion> motion;

  const KeyframeMotion* Motion() const { return motion ? &*motion : nullptr; }

  Calibration Theta() const { return BoxPlus(reference, delta); }
};

View RandomView(RandomValues& random) {
  View view;
  view.reference.imu = random.Imu();
  for (DistortionModel model : DistortionModels()) {
    view.reference.cameras.push_back(random.Camera(model));
  }
  view.camera = random.Index(static_cast<int>(DistortionModels().size()));
  view.q_GI = random.Rotation();
  view.p_GI = random.Normal3(5);
  const CameraCalibration& camera = view.reference.cameras[view.camera];
  const Vector3d p_C =
      random.LogUniform(0.5, 100) *
      Vector3d(random.Uniform(-0.4, 0.4), random.Uniform(-0.4, 0.4), 1);
  view.p_G =
      view.q_GI * (camera.q_CI.conjugate() * (p_C - camera.p_CI)) + view.p_GI;
  view.z_px = camera.c + Vector2d(10 * random.NormalVector(2));
  if (random.Index(2) == 0) view.motion = random.Motion();
  // The last camera has a rolling shutter. Its observations are in the first
  // rows, which move little with a step of the line delay.
  view.reference.cameras.back().line_delay_s = 5e-5;
  // The first one has a clock that drifts, shortly after a session began.
  view.reference.cameras.front().time_drift = 2e-5;
  if (view.motion) view.motion->session_s = 0.7;
  if (view.camera + 1 == std::ssize(view.reference.cameras)) {
    view.z_px.y() *= 0.01;
  }
  view.delta = 0.005 * random.NormalVector(TangentSize(view.reference));
  // A rotation far from the reference, for which derivatives with respect to
  // the offset and to the rotation differ.
  if (random.Index(2) == 0) {
    const int at = CameraTangentOffset(view.reference, view.camera);
    const Vector3d turn = random.Normal3(1);
    view.delta.segment<3>(at + kCameraRotation) = turn;
    CameraCalibration& reference = view.reference.cameras[view.camera];
    reference.q_CI = reference.q_CI * Exp(turn).conjugate();
  }
  return view;
}

// An anchor from which the landmark lies ahead; not so far that a step of the
// differences in inverse depth would carry it across the camera.
LandmarkAnchor RandomAnchor(RandomValues& random, const Vector3d& p_G) {
  const Vector3d p_A(random.Normal(), random.Normal(), random.Uniform(1, 4));
  LandmarkAnchor anchor;
  anchor.R_GA = random.Rotation().toRotationMatrix();
  anchor.a_G = p_G - anchor.R_GA * p_A;
  return anchor;
}

Blocks BlocksOf(const View& view, const Vector3d& landmark) {
  return {view.delta, view.q_GI.coeffs(), view.p_GI, landmark};
}

TEST(ReprojectionCost, IsThePlainFactorDividedBySigma) {
  RandomValues random(1);
  for (int trial = 0; trial < 1000; ++trial) {
    const View view = RandomView(random);
    const auto cost = MakeReprojectionCost(view.reference,
                                           view.camera,
                                           view.z_px,
                                           kSigma,
                                           std::nullopt,
                                           view.Motion());
    const VectorXd residuals =
        EvaluateCost(*cost, BlocksOf(view, view.p_G), false).residuals;
    Vector2d plain_px;
    ASSERT_TRUE(Reproject(view.q_GI,
                          view.p_GI,
                          view.Theta().cameras[view.camera],
                          view.p_G.homogeneous(),
                          view.z_px,
                          &plain_px,
                          nullptr,
                          view.Motion()));
    EXPECT_LT((residuals - plain_px / kSigma).norm(), 1e-10);

    const LandmarkAnchor anchor = RandomAnchor(random, view.p_G);
    const auto anchored = MakeReprojectionCost(
        view.reference, view.camera, view.z_px, kSigma, anchor, view.Motion());
    const VectorXd same =
        EvaluateCost(
            *anchored, BlocksOf(view, anchor.FromPoint(view.p_G)), false)
            .residuals;
    EXPECT_LT((residuals - same).norm(), 1e-9);
  }
}

TEST(ReprojectionCost, JacobiansMatchDifferencesThroughBothManifolds) {
  RandomValues random(2);
  const auto full = MakeRotationManifold();
  const auto gauge = MakeGaugeRotationManifold();
  for (int trial = 0; trial < 1000; ++trial) {
    const View view = RandomView(random);
    const auto* manifold = trial % 2 == 0 ? full.get() : gauge.get();
    const auto cost = MakeReprojectionCost(view.reference,
                                           view.camera,
                                           view.z_px,
                                           kSigma,
                                           std::nullopt,
                                           view.Motion());
    ExpectJacobiansMatch(*cost,
                         BlocksOf(view, view.p_G),
                         {nullptr, manifold, nullptr, nullptr},
                         kStep,
                         kCostTolerance);
    const LandmarkAnchor anchor = RandomAnchor(random, view.p_G);
    const auto anchored = MakeReprojectionCost(
        view.reference, view.camera, view.z_px, kSigma, anchor, view.Motion());
    const Blocks blocks = BlocksOf(view, anchor.FromPoint(view.p_G));
    ExpectJacobiansMatch(*anchored,
                         blocks,
                         {nullptr, manifold, nullptr, nullptr},
                         kStep,
                         kCostTolerance);
    ExpectBlocksCanBeLeftOut(*anchored, blocks);
    if (HasFailure()) FAIL() << "trial " << trial;
  }
}

TEST(ReprojectionCost, ALandmarkAtInfinityIsAnOrdinaryValue) {
  RandomValues random(3);
  const auto full = MakeRotationManifold();
  for (int trial = 0; trial < 200; ++trial) {
    const View view = RandomView(random);
    const CameraCalibration camera = view.Theta().cameras[view.camera];
    // Anchored at the camera itself.
    LandmarkAnchor anchor;
    anchor.R_GA = (view.q_GI * camera.q_CI.conjugate()).toRotationMatrix();
    anchor.a_G = view.p_GI;
    const auto cost = MakeReprojectionCost(
        view.reference, view.camera, view.z_px, kSigma, anchor, view.Motion());
    const Vector3d landmark(
        random.Uniform(-0.3, 0.3), random.Uniform(-0.3, 0.3), 0);
    ExpectJacobiansMatch(*cost,
                         BlocksOf(view, landmark),
                         {nullptr, full.get(), nullptr, nullptr},
                         kStep,
                         kCostTolerance);
    if (HasFailure()) FAIL() << "trial " << trial;
  }
}

TEST(ReprojectionCost, APointBehindTheCameraIsZeroWithItsJacobians) {
  RandomValues random(4);
  for (int trial = 0; trial < 200; ++trial) {
    View view = RandomView(random);
    view.motion.reset();
    const CameraCalibration camera = view.Theta().cameras[view.camera];
    const Vector3d p_C = -Vector3d::UnitZ();  // which no model sees
    const Vector3d p_G =
        view.q_GI * (camera.q_CI.conjugate() * (p_C - camera.p_CI)) + view.p_GI;
    const auto cost = MakeReprojectionCost(view.reference,
                                           view.camera,
                                           view.z_px,
                                           kSigma,
                                           std::nullopt,
                                           view.Motion());
    const CostEvaluation at = EvaluateCost(*cost, BlocksOf(view, p_G), true);
    EXPECT_EQ(at.residuals.norm(), 0);
    for (const auto& J : at.jacobians) EXPECT_EQ(J.norm(), 0);
    ExpectBlocksCanBeLeftOut(*cost, BlocksOf(view, p_G));
  }
}

TEST(LandmarkAnchor, PointAndInverseDepthAreTheSamePlace) {
  RandomValues random(5);
  for (int trial = 0; trial < 1000; ++trial) {
    const Vector3d p_G = random.Normal3(10);
    const LandmarkAnchor anchor = RandomAnchor(random, p_G);
    const Vector4d homogeneous = anchor.ToHomogeneous(anchor.FromPoint(p_G));
    EXPECT_LT((homogeneous.hnormalized() - p_G).norm(), 1e-12);
    EXPECT_GT(homogeneous[3], 0);
  }
}

}  // namespace
}  // namespace selfcal
