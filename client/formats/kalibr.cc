#include "client/formats/kalibr.h"

#include <fmt/format.h>

#include <algorithm>

#include "client/formats/camera_chain.h"
#include "client/formats/format_error.h"
#include "client/formats/imu_matrices.h"
#include "client/formats/losses.h"
#include "client/formats/tool_models.h"
#include "client/formats/yaml_values.h"

namespace selfcal::client {
namespace {

void CheckReference(const YAML::Node& imu) {
  if (Has(imu, "T_i_b") && !GetMatrix(imu, "T_i_b", 4, 4).isIdentity(1e-9)) {
    throw FormatError(
        "T_i_b is not the identity: use the file with imu0, the reference");
  }
  if (GetDouble(imu, "time_offset", 0) != 0) {
    throw FormatError("time_offset of imu0 is not 0");
  }
}

// Keys of the positions of the axes in I.
constexpr const char* kPositions[] = {"rx_i", "ry_i", "rz_i"};

// Kalibr's positions are those of orthogonal axes, whose forces M mixes;
// selfcal's are those of the axes that are read.
void AddPositionsLoss(const std::string& name,
                      const ImuMatrices& imu,
                      std::vector<Loss>* losses) {
  const Eigen::Matrix3d& r = imu.r;
  const double distance_m =
      std::max((r.col(1) - r.col(0)).norm(), (r.col(2) - r.col(0)).norm());
  Eigen::Matrix3d mixed = imu.A;
  mixed.diagonal().setZero();
  const double part = mixed.cwiseAbs().maxCoeff();
  if (distance_m * part == 0) return;
  losses->push_back(
      {name,
       fmt::format("kalibr's axes of the accelerometer are orthogonal before M "
                   "mixes them, those of selfcal are read: the positions of "
                   "both differ by up to {:.1g} m",
                   distance_m * part),
       true});
}

// Reads the IMU's matrices; without them, readings are used as they are. A
// result of the model "calibrated" repeats those of its input, unused.
ImuMatrices ReadMatrices(const YAML::Node& imu, std::vector<Loss>* losses) {
  ImuMatrices result{Eigen::Matrix3d::Identity(), Eigen::Matrix3d::Identity()};
  if (!Has(imu, "gyroscopes") ||
      (Has(imu, "model") && GetText(imu, "model") == "calibrated")) {
    return result;
  }
  const YAML::Node gyro = Get(imu, "gyroscopes");
  const YAML::Node accel = Get(imu, "accelerometers");
  result.G = GetMatrix(gyro, "M", 3, 3) * GetMatrix(gyro, "C_gyro_i", 3, 3);
  result.A = GetMatrix(accel, "M", 3, 3);
  if (Has(gyro, "A")) {
    result.G_f = GetMatrix(gyro, "A", 3, 3) * GetMatrix(gyro, "C_gyro_i", 3, 3);
  }
  for (int axis = 0; axis < 3; ++axis) {
    if (!Has(accel, kPositions[axis])) continue;
    result.r.col(axis) = GetMatrix(accel, kPositions[axis], 3, 1);
  }
  AddPositionsLoss("accelerometers.M", result, losses);
  return result;
}

// Kalibr's loader stops at values below 0 of a principal point, and of some
// coefficients.
void CheckCamera(std::size_t number, const CameraCalibration& camera) {
  const ToolModel& tool = *FindToolModel("kalibr", camera.model);
  for (int i = 0; i < tool.before_pixels; ++i) {
    const std::string_view name = ModelInfo(camera.model).coefficients[i].name;
    const bool any_sign = tool.name == "ds" && name == "xi";
    if (any_sign || camera.distortion[i] >= 0) continue;
    throw FormatError(fmt::format(
        "cam{} has {} = {}, and kalibr's {} does not accept negative ones",
        number,
        name,
        camera.distortion[i],
        tool.name));
  }
  if (camera.c.minCoeff() >= 0) return;
  throw FormatError(
      fmt::format("cam{} has a principal point at {}, {} px, which kalibr does "
                  "not accept: it must not be below 0",
                  number,
                  camera.c.x(),
                  camera.c.y()));
}

void AddMatricesLoss(const ImuCalibration& imu, std::vector<Loss>* losses) {
  if (IsNominal(imu)) return;
  losses->push_back(
      {"imu_matrices",
       "kalibr writes accelerometers.M, gyroscopes.M and C_gyro_i, A and "
       "positions, but does not read them: as its input, imu.yaml states the "
       "noise alone, and --imu-models scale-misalignment (-size-effect) "
       "estimates them from the identity",
       false});
}

}  // namespace

ImportedRig ImportKalibr(const std::vector<TextFile>& files,
                         const FormatOptions&) {
  const ChainFiles chain = ReadChainFiles(files);
  ImportedRig result;
  CheckReference(chain.imu);
  if (chain.several_imus) {
    result.losses.push_back(
        {"imu1",
         "the file has several IMUs, of which the first is read: state the "
         "second one in a file of the rig (factory.imu1, imu1_noise)",
         true});
  }
  result.rig.imu_noise = ReadChainNoise(chain.imu);
  const ImuInBody body = FromMatrices(ReadMatrices(chain.imu, &result.losses));
  result.rig.factory.imu = body.imu;
  Eigen::Matrix4d T_CB;  // of the previous camera
  for (int j = 0; Has(chain.cameras, fmt::format("cam{}", j)); ++j) {
    const YAML::Node node = chain.cameras[fmt::format("cam{}", j)];
    CameraCalibration camera = ReadChainCamera(node);
    if (Has(node, "T_cam_imu")) {
      T_CB = Rigid(GetMatrix(node, "T_cam_imu", 4, 4), "T_cam_imu");
    } else if (j > 0 && Has(node, "T_cn_cnm1")) {
      T_CB = Rigid(GetMatrix(node, "T_cn_cnm1", 4, 4), "T_cn_cnm1") * T_CB;
    } else {
      throw FormatError(
          "T_cam_imu is missing: use the chain of the calibration with the "
          "IMU (camchain-imucam)");
    }
    SetTransformFromBody(T_CB, body.R_IB.transpose(), &camera);
    result.rig.factory.cameras.push_back(camera);
  }
  return result;
}

ExportedFiles ExportKalibr(const Rig& rig,
                           const Calibration& theta,
                           const FormatOptions& options) {
  ExportedFiles result;
  const AccelFrame body = ToAccelFrame(theta.imu);
  std::string chain;
  Eigen::Matrix4d before;
  std::vector<CameraCalibration> cameras = theta.cameras;
  UseModelsOf("kalibr", &cameras);
  AddPinholeLosses("kalibr", cameras, &result.losses);
  AddLineDelayLosses("kalibr", theta, &result.losses);
  AddTimeDriftLosses("kalibr", theta, &result.losses);
  for (std::size_t j = 0; j < cameras.size(); ++j) {
    const CameraCalibration& camera = cameras[j];
    CheckCamera(j, camera);
    const Eigen::Matrix4d T_CB = TransformFromBody(camera, body.R_BI);
    chain += fmt::format("cam{}:\n  T_cam_imu:\n{}", j, RowsText(T_CB, "  "));
    if (j > 0) {
      chain += fmt::format("  T_cn_cnm1:\n{}",
                           RowsText(T_CB * RigidInverse(before), "  "));
    }
    chain += ChainCameraText(camera);
    chain += fmt::format("  rostopic: /cam{}/image_raw\n", j);
    before = T_CB;
  }
  const Factors gyro = LowerFactors(body.matrices.G);
  std::string positions;
  if (theta.imu.accel_position.size() > 0) {
    for (int axis = 0; axis < 3; ++axis) {
      const Eigen::Vector3d r = body.matrices.r.col(axis);
      positions +=
          fmt::format("  {}: {}\n", kPositions[axis], ListText({r.data(), 3}));
    }
    AddPositionsLoss("imu.accel.position", body.matrices, &result.losses);
  }
  const std::string imu = fmt::format(
      "{}"
      "model: scale-misalignment{}\n"
      "accelerometers:\n  M:\n{}{}"
      "gyroscopes:\n  M:\n{}  A:\n{}  C_gyro_i:\n{}",
      ChainNoiseText(
          rig.imu_noise, ImuRate(options, "update_rate", &result.losses), ""),
      positions.empty() ? "" : "-size-effect",
      RowsText(body.matrices.A, "  "),
      positions,
      RowsText(gyro.triangular, "  "),
      RowsText(body.matrices.G_f * gyro.R.transpose(), "  "),
      RowsText(gyro.R, "  "));
  AddMatricesLoss(theta.imu, &result.losses);
  AddImuBlockLosses("kalibr",
                    {"gyro.g_sensitivity", "accel.position"},
                    theta.imu,
                    &result.losses);
  AddGravityLoss("kalibr", rig, &result.losses);
  result.files = {{"camchain-imucam.yaml", chain}, {"imu.yaml", imu}};
  return result;
}

}  // namespace selfcal::client
