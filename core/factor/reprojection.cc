#include "core/factor/reprojection.h"

#include "core/model/so3.h"

namespace selfcal {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Matrix23d = Eigen::Matrix<double, 2, 3>;

}  // namespace

bool Reproject(const Eigen::Quaterniond& q_GI,
               const Eigen::Vector3d& p_GI,
               const CameraCalibration& camera,
               const Eigen::Vector4d& landmark_G,
               const Eigen::Vector2d& z_px,
               Eigen::Vector2d* residual_px,
               ReprojectionJacobians* jacobians,
               const KeyframeMotion* motion) {
  const ExposurePose exposure =
      motion != nullptr ? MovePose(q_GI, p_GI, *motion, camera, z_px)
                        : PoseAtRest(q_GI, p_GI);
  const Matrix3d R_IG = exposure.q_GI.toRotationMatrix().transpose();
  const Matrix3d R_CI = camera.q_CI.toRotationMatrix();
  const double w = landmark_G[3];
  // The landmark in the body and in the camera frame, both times w.
  const Vector3d p_I = R_IG * (landmark_G.head<3>() - w * exposure.p_GI);
  const Vector3d p_C = R_CI * p_I + w * camera.p_CI;

  Vector2d predicted_px;
  if (jacobians == nullptr) {
    if (!Project(camera, p_C, &predicted_px, nullptr)) return false;
    *residual_px = predicted_px - z_px;
    return true;
  }

  ProjectionJacobians projection;
  if (!Project(camera, p_C, &predicted_px, &projection)) return false;
  *residual_px = predicted_px - z_px;

  const Matrix23d by_p_I = projection.point * R_CI;
  const Matrix23d by_X = by_p_I * R_IG;
  // R_GI Exp(d) rotates p_I by -d, R_CI Exp(d) rotates it by d.
  const Matrix23d by_turn = by_p_I * Skew(p_I);

  Eigen::Matrix<double, 2, 6> by_exposure;
  by_exposure << by_turn, -w * by_X;
  jacobians->pose.leftCols<3>() = by_exposure * exposure.by_rotation;
  jacobians->pose.rightCols<3>() = by_exposure.rightCols<3>();
  jacobians->landmark.leftCols<3>() = by_X;
  jacobians->landmark.col(3) =
      projection.point * camera.p_CI - by_X * exposure.p_GI;
  const int intrinsics = camera.IntrinsicsSize();
  jacobians->camera.resize(2, CameraTangentSize(camera));
  jacobians->camera.middleCols<3>(kCameraRotation) = -by_turn;
  jacobians->camera.middleCols<3>(kCameraPosition) = w * projection.point;
  jacobians->camera.middleCols(kCameraIntrinsics, intrinsics) =
      projection.intrinsics;
  const int time = kCameraIntrinsics + intrinsics;
  jacobians->camera.col(time) = by_exposure * exposure.by_time;
  int next = time + 1;
  if (camera.line_delay_s) {
    jacobians->camera.col(next++) = z_px.y() * jacobians->camera.col(time);
  }
  if (camera.time_drift) {
    jacobians->camera.col(next) = (motion != nullptr ? motion->session_s : 0) *
                                  jacobians->camera.col(time);
  }
  return true;
}

}  // namespace selfcal
