#include <google/protobuf/repeated_field.h>

#include <utility>

#include "proto/convert.h"

namespace selfcal {
namespace {

using Violations = std::vector<Violation>;

void Fill(const Eigen::Vector2d& v, v1::Vector2* message) {
  message->set_x(v.x());
  message->set_y(v.y());
}

void Fill(const Eigen::Vector3d& v, v1::Vector3* message) {
  message->set_x(v.x());
  message->set_y(v.y());
  message->set_z(v.z());
}

void Fill(const Eigen::Quaterniond& q, v1::Quaternion* message) {
  message->set_w(q.w());
  message->set_x(q.x());
  message->set_y(q.y());
  message->set_z(q.z());
}

Eigen::Vector2d Value(const v1::Vector2& message) {
  return {message.x(), message.y()};
}

Eigen::Vector3d Value(const v1::Vector3& message) {
  return {message.x(), message.y(), message.z()};
}

Eigen::Quaterniond Value(const v1::Quaternion& message) {
  return {message.w(), message.x(), message.y(), message.z()};
}

void Require(bool present, std::string field, Violations* violations) {
  if (!present) violations->push_back({std::move(field), "is missing"});
}

v1::DistortionModel ToProto(DistortionModel model) {
  switch (model) {
    case DistortionModel::kFov:
      return v1::DISTORTION_MODEL_FOV;
    case DistortionModel::kRadialTangential:
      return v1::DISTORTION_MODEL_RADIAL_TANGENTIAL;
    case DistortionModel::kEquidistant:
      return v1::DISTORTION_MODEL_EQUIDISTANT;
  }
  return v1::DISTORTION_MODEL_UNSPECIFIED;
}

bool FromProto(v1::DistortionModel message, DistortionModel* model) {
  switch (message) {
    case v1::DISTORTION_MODEL_FOV:
      *model = DistortionModel::kFov;
      return true;
    case v1::DISTORTION_MODEL_RADIAL_TANGENTIAL:
      *model = DistortionModel::kRadialTangential;
      return true;
    case v1::DISTORTION_MODEL_EQUIDISTANT:
      *model = DistortionModel::kEquidistant;
      return true;
    default:
      return false;
  }
}

void FillCamera(const CameraCalibration& camera,
                v1::CameraCalibration* message) {
  Fill(camera.q_CI, message->mutable_q_ci());
  Fill(camera.p_CI, message->mutable_p_ci());
  Fill(camera.f, message->mutable_f());
  Fill(camera.c, message->mutable_c());
  message->set_distortion_model(ToProto(camera.model));
  message->mutable_distortion()->Add(camera.distortion.begin(),
                                     camera.distortion.end());
  message->set_width_px(camera.width_px);
  message->set_height_px(camera.height_px);
  message->set_time_offset_s(camera.time_offset_s);
}

void ReadDistortion(const v1::CameraCalibration& message,
                    const std::string& prefix,
                    CameraCalibration* camera,
                    Violations* violations) {
  if (!FromProto(message.distortion_model(), &camera->model)) {
    violations->push_back(
        {prefix + "distortion_model",
         "is " + std::to_string(static_cast<int>(message.distortion_model())) +
             "; send one of the models of DistortionModel"});
    return;
  }
  const int size = DistortionSize(camera->model);
  if (message.distortion_size() != size) {
    violations->push_back({prefix + "distortion",
                           "has " + std::to_string(message.distortion_size()) +
                               " coefficients; the model takes " +
                               std::to_string(size)});
    return;
  }
  camera->distortion =
      Eigen::Map<const Eigen::VectorXd>(message.distortion().data(), size);
}

void ReadCamera(const v1::CameraCalibration& message,
                const std::string& prefix,
                CameraCalibration* camera,
                Violations* violations) {
  Require(message.has_q_ci(), prefix + "q_ci", violations);
  Require(message.has_p_ci(), prefix + "p_ci", violations);
  Require(message.has_f(), prefix + "f", violations);
  Require(message.has_c(), prefix + "c", violations);
  camera->q_CI = Value(message.q_ci());
  camera->p_CI = Value(message.p_ci());
  camera->f = Value(message.f());
  camera->c = Value(message.c());
  camera->width_px = message.width_px();
  camera->height_px = message.height_px();
  camera->time_offset_s = message.time_offset_s();
  ReadDistortion(message, prefix, camera, violations);
}

void ReadImu(const v1::ImuCalibration& message,
             const std::string& prefix,
             ImuCalibration* imu,
             Violations* violations) {
  Require(message.has_s_g(), prefix + "s_g", violations);
  Require(message.has_m_g(), prefix + "m_g", violations);
  Require(message.has_s_a(), prefix + "s_a", violations);
  Require(message.has_m_a(), prefix + "m_a", violations);
  Require(message.has_q_ai(), prefix + "q_ai", violations);
  imu->s_g = Value(message.s_g());
  imu->m_g = Value(message.m_g());
  imu->s_a = Value(message.s_a());
  imu->m_a = Value(message.m_a());
  imu->q_AI = Value(message.q_ai());
}

}  // namespace

v1::CalibrationParameters ToProto(const Calibration& theta) {
  v1::CalibrationParameters message;
  v1::ImuCalibration* imu = message.mutable_imu();
  Fill(theta.imu.s_g, imu->mutable_s_g());
  Fill(theta.imu.m_g, imu->mutable_m_g());
  Fill(theta.imu.s_a, imu->mutable_s_a());
  Fill(theta.imu.m_a, imu->mutable_m_a());
  Fill(theta.imu.q_AI, imu->mutable_q_ai());
  for (const CameraCalibration& camera : theta.cameras) {
    FillCamera(camera, message.add_cameras());
  }
  return message;
}

Violations FromProto(const v1::CalibrationParameters& message,
                     const std::string& prefix,
                     Calibration* theta) {
  Violations violations;
  Calibration read;
  if (message.has_imu()) {
    ReadImu(message.imu(), prefix + "imu.", &read.imu, &violations);
  } else {
    Require(false, prefix + "imu", &violations);
  }
  read.cameras.resize(message.cameras_size());
  for (int i = 0; i < message.cameras_size(); ++i) {
    ReadCamera(message.cameras(i),
               prefix + "cameras[" + std::to_string(i) + "].",
               &read.cameras[i],
               &violations);
  }
  if (violations.empty()) *theta = std::move(read);
  return violations;
}

}  // namespace selfcal
