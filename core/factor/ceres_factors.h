// Wraps the plain factors (inertial.h, reprojection.h) as Ceres cost functions,
// and provides the manifolds of their parameters.
//
// Parameter blocks, all double arrays:
//   theta  [D] tangent offset d from a fixed reference: theta = ref [+] d.
//              One block for the whole calibration, so that a subspace of it
//              can be held constant (SubspaceManifold);
//   q      [4] q_GI as Eigen stores it (x, y, z, w), with RotationManifold;
//   p      [3] p_GI [m];
//   vb     [9] (v_GI 3, b_a 3, b_g 3), or those of the second IMU;
//   l      [3] landmark, either p_G [m], or (alpha, beta, rho) anchored at a
//              fixed place: p_G = a + R_GA (alpha, beta, 1) / rho.
// The caller owns the returned object; data that a factory takes by span or
// reference must outlive it. Evaluate may be called from many threads.
#pragma once

#include <ceres/cost_function.h>
#include <ceres/manifold.h>

#include <Eigen/Core>
#include <memory>
#include <optional>

#include "core/factor/inertial.h"
#include "core/factor/landmark_anchor.h"
#include "core/factor/reprojection.h"

namespace selfcal {

// Blocks (theta, q, p, l); 2 residuals, divided by sigma_px. If the point
// cannot be projected, the residual and its Jacobians are zero: such an
// observation has no information, and the caller counts it. The motion is
// copied; null as in Reproject.
std::unique_ptr<ceres::CostFunction> MakeReprojectionCost(
    const Calibration& theta_reference,
    int camera,
    const Eigen::Vector2d& z_px,
    double sigma_px,
    const std::optional<LandmarkAnchor>& anchor,
    const KeyframeMotion* motion = nullptr);

// Blocks (theta, q0, p0, vb0, q1, p1, vb1); 15 residuals of an IMU
// (second_imu.h), whitened by the given square root information, which is
// constant during the lifetime of the factor: the noise does not depend on the
// estimate.
std::unique_ptr<ceres::CostFunction> MakeInertialCost(
    const Calibration& theta_reference,
    int imu,
    std::span<const ImuSample> samples,
    std::int64_t t0_ns,
    std::int64_t t1_ns,
    const ImuNoise& noise,
    double gravity_mps2,
    const InertialMatrix& square_root_information);

// Blocks (vb0, vb1); 6 residuals: the biases (b_a, b_g) of vb1 minus those of
// vb0, divided by sigmas (BiasWalkSigmas).
std::unique_ptr<ceres::CostFunction> MakeBiasWalkCost(
    const Eigen::Matrix<double, 6, 1>& sigmas);

// The same factor at a temperature (core/model/temperature.h). `cost` has
// blocks (theta, ...) about AtTemperature(theta_reference, temperature_c), the
// result has them about theta_reference.
std::unique_ptr<ceres::CostFunction> MakeTemperatureCost(
    const Calibration& theta_reference,
    double temperature_c,
    std::unique_ptr<ceres::CostFunction> cost);

// One block x of the size of `mean`; residual = square_root (x - mean).
std::unique_ptr<ceres::CostFunction> MakePriorCost(
    const Eigen::MatrixXd& square_root, const Eigen::VectorXd& mean);

// q [+] d = q Exp(d), d in rad: ambient 4, tangent 3.
std::unique_ptr<ceres::Manifold> MakeRotationManifold();

// The rotation of the keyframe that holds the gauge: only roll and pitch vary.
// q [+] d = Exp((d_0, d_1, 0)) q with the axis in G, so the tangent has no
// component about gravity at any attitude of the body. Ambient 4, tangent 2.
std::unique_ptr<ceres::Manifold> MakeGaugeRotationManifold();

// x [+] d = x + B d for a D x r basis B of full column rank: directions outside
// its span are held constant. Ambient D, tangent r.
std::unique_ptr<ceres::Manifold> MakeSubspaceManifold(
    const Eigen::MatrixXd& basis);

}  // namespace selfcal
