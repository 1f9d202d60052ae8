#include "core/factor/ceres_factors.h"
#include "core/factor/quaternion_block.h"
#include "core/factor/theta_block.h"

namespace selfcal {
namespace {

using Eigen::Map;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::Vector4d;
template <int cols>
using RowMajor2 = Eigen::Matrix<double, 2, cols, Eigen::RowMajor>;
// A row-major matrix of one dynamic dimension.
using RowMajor2Xd = RowMajor2<Eigen::Dynamic>;

enum Block { kTheta, kRotation, kPosition, kLandmark, kBlocks };

class ReprojectionCost final : public ceres::CostFunction {
 public:
  ReprojectionCost(const Calibration& theta_reference,
                   int camera,
                   const Vector2d& z_px,
                   double sigma_px,
                   const std::optional<LandmarkAnchor>& anchor,
                   const KeyframeMotion* motion)
      : camera_reference_(theta_reference.cameras[camera]),
        camera_offset_(CameraTangentOffset(theta_reference, camera)),
        theta_size_(TangentSize(theta_reference)),
        z_px_(z_px),
        inverse_sigma_(1 / sigma_px),
        anchor_(anchor) {
    if (motion != nullptr) motion_ = *motion;
    set_num_residuals(2);
    *mutable_parameter_block_sizes() = {theta_size_, 4, 3, 3};
  }

  bool Evaluate(double const* const* parameters,
                double* residuals,
                double** jacobians) const override {
    const Eigen::Quaterniond q_GI = ReadQuaternion(parameters[kRotation]);
    const Map<const Vector3d> p_GI(parameters[kPosition]);
    const Map<const Vector3d> l(parameters[kLandmark]);
    const double* camera_theta = parameters[kTheta] + camera_offset_;
    const Vector4d landmark_G =
        anchor_ ? anchor_->ToHomogeneous(l) : Vector4d(l.homogeneous());

    Vector2d residual_px = Vector2d::Zero();
    ReprojectionJacobians J;
    const bool visible =
        Reproject(q_GI,
                  p_GI,
                  OffsetCamera(camera_reference_, camera_theta),
                  landmark_G,
                  z_px_,
                  &residual_px,
                  jacobians == nullptr ? nullptr : &J,
                  motion_ ? &*motion_ : nullptr);
    Map<Vector2d> r(residuals);
    r = inverse_sigma_ * residual_px;
    if (jacobians == nullptr) return true;
    if (visible) {
      WriteJacobians(q_GI, camera_theta, J, jacobians);
    } else {
      ZeroJacobians(jacobians);
    }
    return true;
  }

 private:
  void WriteJacobians(const Eigen::Quaterniond& q_GI,
                      const double* camera_theta,
                      const ReprojectionJacobians& J,
                      double** jacobians) const {
    if (double* out = jacobians[kTheta]) {
      auto by_camera = J.camera;
      ByRotationOffset(camera_theta + kCameraRotation,
                       by_camera.middleCols<3>(kCameraRotation));
      Map<RowMajor2Xd> by_theta(out, 2, theta_size_);
      by_theta.setZero();
      by_theta.middleCols(camera_offset_, by_camera.cols()) =
          inverse_sigma_ * by_camera;
    }
    if (double* out = jacobians[kRotation]) {
      Map<RowMajor2<4>> by_q(out);
      by_q =
          inverse_sigma_ * J.pose.leftCols<3>() * QuaternionMinusJacobian(q_GI);
    }
    if (double* out = jacobians[kPosition]) {
      Map<RowMajor2<3>> by_p(out);
      by_p = inverse_sigma_ * J.pose.rightCols<3>();
    }
    if (double* out = jacobians[kLandmark]) {
      Map<RowMajor2<3>> by_l(out);
      by_l = inverse_sigma_ * J.landmark.leftCols<3>();
      if (anchor_) {
        // X = R (alpha, beta, 1) + rho a, w = rho.
        by_l = (by_l * anchor_->R_GA).eval();
        by_l.col(2) =
            inverse_sigma_ *
            (J.landmark.leftCols<3>() * anchor_->a_G + J.landmark.col(3));
      }
    }
  }

  void ZeroJacobians(double** jacobians) const {
    for (int block = 0; block < kBlocks; ++block) {
      if (jacobians[block] == nullptr) continue;
      Map<Eigen::VectorXd>(jacobians[block], 2 * parameter_block_sizes()[block])
          .setZero();
    }
  }

  const CameraCalibration camera_reference_;
  const int camera_offset_;
  const int theta_size_;
  const Vector2d z_px_;
  const double inverse_sigma_;
  const std::optional<LandmarkAnchor> anchor_;
  std::optional<KeyframeMotion> motion_;
};

}  // namespace

std::unique_ptr<ceres::CostFunction> MakeReprojectionCost(
    const Calibration& theta_reference,
    int camera,
    const Eigen::Vector2d& z_px,
    double sigma_px,
    const std::optional<LandmarkAnchor>& anchor,
    const KeyframeMotion* motion) {
  return std::make_unique<ReprojectionCost>(
      theta_reference, camera, z_px, sigma_px, anchor, motion);
}

}  // namespace selfcal
