#include "client/formats/basalt.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>
#include <nlohmann/json.hpp>
#include <vector>

#include "client/formats/basalt_camera.h"
#include "client/formats/format_error.h"
#include "client/formats/imu_matrices.h"
#include "client/formats/json_values.h"
#include "client/formats/losses.h"
#include "client/formats/tool_models.h"

namespace selfcal::client {
namespace {

using Json = nlohmann::ordered_json;

Eigen::Matrix4d ReadPose(const Json& node) {
  const Eigen::Quaterniond q(JsonNumber(node, "qw"),
                             JsonNumber(node, "qx"),
                             JsonNumber(node, "qy"),
                             JsonNumber(node, "qz"));
  if (!(std::abs(q.norm() - 1) < 1e-3)) {
    throw FormatError("a quaternion of T_imu_cam is not of norm 1");
  }
  Eigen::Matrix4d T = Eigen::Matrix4d::Identity();
  T.topLeftCorner<3, 3>() = q.normalized().toRotationMatrix();
  T.topRightCorner<3, 1>() = Eigen::Vector3d(
      JsonNumber(node, "px"), JsonNumber(node, "py"), JsonNumber(node, "pz"));
  return T;
}

Json PoseJson(const Eigen::Matrix4d& T) {
  const Eigen::Matrix3d R = T.topLeftCorner<3, 3>();
  const Eigen::Quaterniond q(R);
  return {{"px", T(0, 3)},
          {"py", T(1, 3)},
          {"pz", T(2, 3)},
          {"qx", q.x()},
          {"qy", q.y()},
          {"qz", q.z()},
          {"qw", q.w()}};
}

// Records the loss of constant biases, which selfcal's calibration does not
// have.
void AddBiasLoss(const std::string& field,
                 const Eigen::Vector3d& bias,
                 const Eigen::Matrix3d& inverse,
                 std::vector<Loss>* losses) {
  if (bias.isZero(0)) return;
  const Eigen::Vector3d raw = inverse.inverse() * bias;
  losses->push_back(
      {field,
       fmt::format("selfcal estimates biases as states, not in the "
                   "calibration; in terms of the readings they are {} {} {}",
                   raw.x(),
                   raw.y(),
                   raw.z()),
       true});
}

ImuMatrices ReadMatrices(const Json& root, std::vector<Loss>* losses) {
  const std::vector<double> a = JsonNumbers(root, "calib_accel_bias", 9);
  const std::vector<double> g = JsonNumbers(root, "calib_gyro_bias", 12);
  Eigen::Matrix3d accel = Eigen::Matrix3d::Identity();
  accel.col(0) += Eigen::Vector3d(a[3], a[4], a[5]);
  accel(1, 1) += a[6];
  accel(2, 1) += a[7];
  accel(2, 2) += a[8];
  const Eigen::Matrix3d gyro = Eigen::Matrix3d::Identity() +
                               Eigen::Map<const Eigen::Matrix3d>(g.data() + 3);
  for (const Eigen::Matrix3d& M : {accel, gyro}) {
    if (!(M.determinant() > 1e-6)) {
      throw FormatError("a matrix of the IMU is singular or mirrors its axes");
    }
  }
  AddBiasLoss("calib_accel_bias", {a[0], a[1], a[2]}, accel, losses);
  AddBiasLoss("calib_gyro_bias", {g[0], g[1], g[2]}, gyro, losses);
  return {.G = gyro.inverse(), .A = accel.inverse()};
}

double ReadNoise(const Json& root,
                 const std::string& key,
                 std::vector<Loss>* losses) {
  const std::vector<double> axes = JsonNumbers(root, key, 3);
  if (axes[0] == axes[1] && axes[0] == axes[2]) return axes[0];
  losses->push_back(
      {key,
       "selfcal has one value for all axes: the root mean square is used",
       false});
  return std::sqrt((axes[0] * axes[0] + axes[1] * axes[1] + axes[2] * axes[2]) /
                   3);
}

Json AccelJson(const Eigen::Matrix3d& A) {
  const Eigen::Matrix3d M =
      A.triangularView<Eigen::Lower>().solve(Eigen::Matrix3d::Identity()) -
      Eigen::Matrix3d::Identity();
  return {0.0, 0.0, 0.0, M(0, 0), M(1, 0), M(2, 0), M(1, 1), M(2, 1), M(2, 2)};
}

Json GyroJson(const Eigen::Matrix3d& G) {
  const Eigen::Matrix3d M = G.inverse() - Eigen::Matrix3d::Identity();
  Json list = {0.0, 0.0, 0.0};
  for (const double value : M.reshaped()) list.push_back(value);
  return list;
}

void AddOdometryLoss(double time_offset_s, std::vector<Loss>* losses) {
  if (time_offset_s == 0) return;
  losses->push_back(
      {"cam_time_offset_ns",
       fmt::format(
           "Basalt's calibration applies it, its odometry does not: for "
           "the odometry, add {} s to the timestamps of the images",
           time_offset_s),
       true});
}

void ReadCameras(const Json& root,
                 const Eigen::Matrix3d& R_BI,
                 ImportedRig* result) {
  const Json& poses = JsonList(root, "T_imu_cam");
  const Json& intrinsics = JsonList(root, "intrinsics");
  const Json& sizes = JsonList(root, "resolution");
  if (poses.size() != intrinsics.size() || poses.size() != sizes.size()) {
    throw FormatError("T_imu_cam, intrinsics and resolution differ in length");
  }
  for (std::size_t j = 0; j < poses.size(); ++j) {
    CameraCalibration camera = ReadBasaltCamera(intrinsics[j], &result->losses);
    SetBasaltResolution(sizes[j], &camera);
    SetTransformFromBody(RigidInverse(ReadPose(poses[j])), R_BI, &camera);
    camera.time_offset_s = JsonNumber(root, "cam_time_offset_ns") / kNsPerS;
    result->rig.factory.cameras.push_back(camera);
  }
}

}  // namespace

ImportedRig ImportBasalt(const std::vector<TextFile>& files,
                         const FormatOptions&) {
  if (files.size() != 1) throw FormatError("give one file");
  const Json document = ParseJson(files[0].text);
  const Json& root = JsonMember(document, "value0");
  ImportedRig result;
  std::vector<Loss>* losses = &result.losses;
  result.rig.imu_noise = {
      .gyro_noise_density = ReadNoise(root, "gyro_noise_std", losses),
      .accel_noise_density = ReadNoise(root, "accel_noise_std", losses),
      .gyro_bias_random_walk = ReadNoise(root, "gyro_bias_std", losses),
      .accel_bias_random_walk = ReadNoise(root, "accel_bias_std", losses)};
  const ImuInBody body = FromMatrices(ReadMatrices(root, losses));
  result.rig.factory.imu = body.imu;
  ReadCameras(root, body.R_IB.transpose(), &result);
  if (root.contains("vignette") && !root["vignette"].empty()) {
    losses->push_back({"vignette", "selfcal has none: ignored", false});
  }
  return result;
}

ExportedFiles ExportBasalt(const Rig& rig,
                           const Calibration& theta,
                           const FormatOptions& options) {
  ExportedFiles result;
  const AccelFrame body = ToAccelFrame(theta.imu);
  Json poses = Json::array();
  Json intrinsics = Json::array();
  Json sizes = Json::array();
  std::vector<CameraCalibration> cameras = theta.cameras;
  UseModelsOf("basalt", &cameras);
  for (const CameraCalibration& camera : cameras) {
    poses.push_back(
        PoseJson(RigidInverse(TransformFromBody(camera, body.R_BI))));
    intrinsics.push_back(BasaltCameraJson(camera));
    sizes.push_back({camera.width_px, camera.height_px});
  }
  const auto all_axes = [](double value) { return Json{value, value, value}; };
  const ImuNoise& noise = rig.imu_noise;
  Json root;
  root["T_imu_cam"] = poses;
  root["intrinsics"] = intrinsics;
  root["resolution"] = sizes;
  root["calib_accel_bias"] = AccelJson(body.matrices.A);
  root["calib_gyro_bias"] = GyroJson(body.matrices.G);
  root["imu_update_rate"] = ImuRate(options, "imu_update_rate", &result.losses);
  root["accel_noise_std"] = all_axes(noise.accel_noise_density);
  root["gyro_noise_std"] = all_axes(noise.gyro_noise_density);
  root["accel_bias_std"] = all_axes(noise.accel_bias_random_walk);
  root["gyro_bias_std"] = all_axes(noise.gyro_bias_random_walk);
  root["cam_time_offset_ns"] = static_cast<std::int64_t>(
      std::llround(theta.cameras[0].time_offset_s * kNsPerS));
  root["vignette"] = Json::array();
  AddImuBlockLosses("basalt", {}, "imu", theta.imu, &result.losses);
  AddOdometryLoss(theta.cameras[0].time_offset_s, &result.losses);
  AddSharedOffsetLosses("basalt", theta, &result.losses);
  AddLineDelayLosses("basalt", theta, &result.losses);
  AddTimeDriftLosses("basalt", theta, &result.losses);
  AddGravityLoss("basalt", rig, &result.losses);
  result.files = {{"calibration.json", Json{{"value0", root}}.dump(2) + "\n"}};
  return result;
}

}  // namespace selfcal::client
