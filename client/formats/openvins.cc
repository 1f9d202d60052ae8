#include "client/formats/openvins.h"

#include <fmt/format.h>

#include "client/formats/camera_chain.h"
#include "client/formats/format_error.h"
#include "client/formats/imu_matrices.h"
#include "client/formats/losses.h"
#include "client/formats/tool_models.h"
#include "client/formats/yaml_values.h"

namespace selfcal::client {
namespace {

// Reads a triangular matrix, and fails for others: OpenVINS would silently use
// their triangle.
Eigen::Matrix3d ReadTriangle(const YAML::Node& imu,
                             const std::string& key,
                             bool upper) {
  if (!Has(imu, key)) return Eigen::Matrix3d::Identity();
  const Eigen::Matrix3d T = GetMatrix(imu, key, 3, 3);
  const Eigen::Matrix3d other =
      upper ? T.triangularView<Eigen::StrictlyLower>().toDenseMatrix()
            : T.triangularView<Eigen::StrictlyUpper>().toDenseMatrix();
  if (other.isZero(1e-9)) return T;
  throw FormatError(
      fmt::format("field '{}' is not {} triangular, as the model requires",
                  key,
                  upper ? "upper" : "lower"));
}

Eigen::Matrix3d ReadRotation(const YAML::Node& imu, const std::string& key) {
  if (!Has(imu, key)) return Eigen::Matrix3d::Identity();
  Eigen::Matrix4d T = Eigen::Matrix4d::Identity();
  T.topLeftCorner<3, 3>() = GetMatrix(imu, key, 3, 3);
  return Rigid(T, key).topLeftCorner<3, 3>();
}

ImuMatrices ReadMatrices(const YAML::Node& imu) {
  const std::string model =
      Has(imu, "model") ? GetText(imu, "model") : "calibrated";
  if (model != "rpng" && model != "kalibr" && model != "calibrated") {
    throw FormatError(
        fmt::format("model '{}' is not calibrated, kalibr or rpng", model));
  }
  const bool upper = model == "rpng";
  ImuMatrices result = {
      .G = ReadTriangle(imu, "Tw", upper) * ReadRotation(imu, "R_IMUtoGYRO"),
      .A = ReadTriangle(imu, "Ta", upper) * ReadRotation(imu, "R_IMUtoACC")};
  if (Has(imu, "Tg")) result.G_f = GetMatrix(imu, "Tg", 3, 3);
  return result;
}

Eigen::Matrix4d ReadExtrinsics(const YAML::Node& node) {
  if (Has(node, "T_cam_imu")) {
    return Rigid(GetMatrix(node, "T_cam_imu", 4, 4), "T_cam_imu");
  }
  return RigidInverse(Rigid(GetMatrix(node, "T_imu_cam", 4, 4), "T_imu_cam"));
}

}  // namespace

ImportedRig ImportOpenVins(const std::vector<TextFile>& files,
                           const FormatOptions&) {
  const ChainFiles chain = ReadChainFiles(files, 1);
  const YAML::Node& imu = chain.imus.front();
  ImportedRig result;
  if (chain.imus.size() > 1) {
    result.losses.push_back({"imu1",
                             fmt::format("there are {} IMUs, and OpenVINS has "
                                         "one, the first: omitted",
                                         chain.imus.size()),
                             true});
  }
  result.rig.imu_noise = ReadChainNoise(imu);
  const ImuInBody body = FromMatrices(ReadMatrices(imu));
  result.rig.factory.imu = body.imu;
  for (int j = 0; Has(chain.cameras, fmt::format("cam{}", j)); ++j) {
    const YAML::Node node = chain.cameras[fmt::format("cam{}", j)];
    CameraCalibration camera = ReadChainCamera(node);
    if (FindToolModel("openvins", camera.model) == nullptr) {
      throw FormatError(
          fmt::format("camera_model '{}' with distortion_model '{}' is not "
                      "supported by OpenVINS",
                      GetText(node, "camera_model"),
                      GetText(node, "distortion_model")));
    }
    SetTransformFromBody(ReadExtrinsics(node), body.R_IB.transpose(), &camera);
    auto& cameras = result.rig.factory.cameras;
    cameras.push_back(camera);
    if (camera.time_offset_s == cameras[0].time_offset_s) continue;
    cameras.back().time_offset_s = cameras[0].time_offset_s;
    result.losses.push_back(
        {fmt::format("cam{}.timeshift_cam_imu", j),
         "OpenVINS uses that of cam0 for all cameras; it is read in this way",
         false});
  }
  return result;
}

ExportedFiles ExportOpenVins(const Rig& rig,
                             const Calibration& theta,
                             const FormatOptions& options) {
  ExportedFiles result;
  // cv::FileStorage requires this first line.
  std::string chain = "%YAML:1.0\n---\n";
  std::vector<CameraCalibration> cameras = theta.cameras;
  UseModelsOf("openvins", &cameras);
  AddPinholeLosses("openvins", cameras, &result.losses);
  for (std::size_t j = 0; j < cameras.size(); ++j) {
    CameraCalibration& camera = cameras[j];
    camera.time_offset_s = theta.cameras[0].time_offset_s;
    const Eigen::Matrix4d T_IC =
        RigidInverse(TransformFromBody(camera, Eigen::Matrix3d::Identity()));
    chain +=
        fmt::format("cam{}:\n  T_imu_cam:\n{}{}  rostopic: /cam{}/image_raw\n",
                    j,
                    RowsText(T_IC, "    "),
                    ChainCameraText(camera),
                    j);
  }
  const std::string imu = fmt::format(
      "%YAML:1.0\n---\n"
      "imu0:\n"
      "  T_i_b:\n{}"
      "{}"
      "  model: \"rpng\"\n"
      "  Tw:\n{}  R_IMUtoGYRO:\n{}  Ta:\n{}  R_IMUtoACC:\n{}  Tg:\n{}",
      RowsText(Eigen::Matrix4d::Identity(), "    "),
      ChainNoiseText(rig.imu_noise,
                     0,
                     0,
                     ImuRate(options, "update_rate", &result.losses),
                     "  "),
      RowsText(theta.imu.T_g(), "    "),
      RowsText(Eigen::Matrix3d::Identity(), "    "),
      RowsText(theta.imu.T_a(), "    "),
      RowsText(theta.imu.q_AI.normalized().toRotationMatrix(), "    "),
      RowsText(theta.imu.T_s(), "    "));
  AddImuBlockLosses(
      "openvins", {"gyro.g_sensitivity"}, "imu", theta.imu, &result.losses);
  AddSharedOffsetLosses("openvins", theta, &result.losses);
  AddLineDelayLosses("openvins", theta, &result.losses);
  AddTimeDriftLosses("openvins", theta, &result.losses);
  AddGravityLoss("openvins", rig, &result.losses);
  result.files = {{"kalibr_imucam_chain.yaml", chain},
                  {"kalibr_imu_chain.yaml", imu}};
  return result;
}

}  // namespace selfcal::client
