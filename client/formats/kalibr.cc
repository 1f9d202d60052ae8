#include "client/formats/kalibr.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <vector>

#include "client/formats/camera_chain.h"
#include "client/formats/format_error.h"
#include "client/formats/imu_matrices.h"
#include "client/formats/losses.h"
#include "client/formats/tool_models.h"
#include "client/formats/yaml_values.h"

namespace selfcal::client {
namespace {

// The IMU whose frame is that of the body, and another one if there is one.
struct FoundImus {
  YAML::Node reference;
  std::optional<YAML::Node> second;
};

FoundImus FindImus(const ChainFiles& chain, std::vector<Loss>* losses) {
  std::vector<YAML::Node> references, others;
  for (const YAML::Node& imu : chain.imus) {
    const bool reference =
        !Has(imu, "T_i_b") || GetMatrix(imu, "T_i_b", 4, 4).isIdentity(1e-9);
    (reference ? references : others).push_back(imu);
  }
  if (references.empty()) {
    throw FormatError(
        "T_i_b is not the identity: use the file with imu0, the reference");
  }
  if (references.size() > 1) {
    throw FormatError(
        "several IMUs are the reference, as they have no T_i_b or the "
        "identity: use the files that kalibr has written, or leave out the "
        "second one");
  }
  if (GetDouble(references.front(), "time_offset", 0) != 0) {
    throw FormatError("time_offset of imu0 is not 0");
  }
  if (others.size() > 1) {
    losses->push_back({"imu2",
                       fmt::format("there are {} IMUs, of which the first two "
                                   "are read: omitted",
                                   chain.imus.size()),
                       true});
  }
  if (others.empty()) return {references.front(), std::nullopt};
  return {references.front(), others.front()};
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

// Kalibr's gyroscope is sensitive to the force at the origin of the IMU,
// selfcal's to the force that the accelerometer reads where it is.
void AddSensitivityLoss(const std::string& imu,
                        const ImuMatrices& matrices,
                        std::vector<Loss>* losses) {
  if (matrices.G_f.isZero(0) || matrices.r.isZero(0)) return;
  losses->push_back(
      {imu + ".gyro.g_sensitivity",
       "kalibr's is one to the force at the origin of the IMU, selfcal's to "
       "that at the position of the accelerometer: rates differ when the "
       "device turns fast",
       true});
}

// Reads an IMU's matrices; without them, readings are used as they are. A
// result of the model "calibrated" repeats those of its input, unused. `name`
// is "imu" or "imu1", and names of losses that are keys begin with `prefix`.
ImuMatrices ReadMatrices(const std::string& name,
                         const std::string& prefix,
                         const YAML::Node& imu,
                         std::vector<Loss>* losses) {
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
  AddPositionsLoss(prefix + "accelerometers.M", result, losses);
  AddSensitivityLoss(name, result, losses);
  return result;
}

// Reads the second IMU; R_IB is of the first.
void ReadSecondImu(const YAML::Node& imu,
                   const Eigen::Matrix3d& R_IB,
                   ImportedRig* result) {
  const ImuInBody own =
      FromMatrices(ReadMatrices("imu1", "imu1.", imu, &result->losses));
  // J is the frame of its gyroscope, K that of its accelerometer.
  const Eigen::Matrix3d& R_JK = own.R_IB;
  const Eigen::Matrix4d T_KB = Rigid(GetMatrix(imu, "T_i_b", 4, 4), "T_i_b");
  SecondImuCalibration& imu1 = result->rig.factory.imu1.emplace();
  static_cast<ImuCalibration&>(imu1) = own.imu;
  imu1.q_JI =
      Eigen::Quaterniond(R_JK * T_KB.topLeftCorner<3, 3>() * R_IB.transpose())
          .normalized();
  imu1.p_JI = R_JK * T_KB.topRightCorner<3, 1>();
  result->rig.imu1_noise = ReadChainNoise(imu);
  result->losses.push_back(
      {"imu1.T_i_b",
       "is read as the transform from body to IMU that kalibr writes since "
       "August 2022; before, it wrote the position of the IMU in the body into "
       "it",
       false});
  imu1.time_offset_s = GetDouble(imu, "time_offset", 0);
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

std::string ImuText(const AccelFrame& body,
                    const std::string& noise,
                    bool has_positions) {
  const Factors gyro = LowerFactors(body.matrices.G);
  std::string positions;
  for (int axis = 0; has_positions && axis < 3; ++axis) {
    const Eigen::Vector3d r = body.matrices.r.col(axis);
    positions +=
        fmt::format("  {}: {}\n", kPositions[axis], ListText({r.data(), 3}));
  }
  return fmt::format(
      "{}"
      "model: scale-misalignment{}\n"
      "accelerometers:\n  M:\n{}{}"
      "gyroscopes:\n  M:\n{}  A:\n{}  C_gyro_i:\n{}",
      noise,
      has_positions ? "-size-effect" : "",
      RowsText(body.matrices.A, "  "),
      positions,
      RowsText(gyro.triangular, "  "),
      RowsText(body.matrices.G_f * gyro.R.transpose(), "  "),
      RowsText(gyro.R, "  "));
}

// The losses of an IMU, "imu" or "imu1".
void AddImuLosses(const std::string& name,
                  const ImuCalibration& imu,
                  const AccelFrame& body,
                  std::vector<Loss>* losses) {
  if (imu.accel_position.size() > 0) {
    AddPositionsLoss(name + ".accel.position", body.matrices, losses);
    AddSensitivityLoss(name, body.matrices, losses);
  }
  AddImuBlockLosses(
      "kalibr", {"gyro.g_sensitivity", "accel.position"}, name, imu, losses);
}

// The file of the second IMU; R_BI is of the first.
TextFile WriteSecondImu(const Rig& rig,
                        const SecondImuCalibration& imu1,
                        const Eigen::Matrix3d& R_BI,
                        double rate_hz,
                        std::vector<Loss>* losses) {
  const AccelFrame own = ToAccelFrame(imu1);
  Eigen::Matrix4d T_KB = Eigen::Matrix4d::Identity();
  T_KB.topLeftCorner<3, 3>() =
      own.R_BI * imu1.q_JI.normalized() * R_BI.transpose();
  T_KB.topRightCorner<3, 1>() = own.R_BI * imu1.p_JI;
  AddImuLosses("imu1", imu1, own, losses);
  losses->push_back({"imu1.T_i_b",
                     "kalibr writes it and time_offset, but does not read "
                     "them: with --imu imu.yaml imu1.yaml it begins at a "
                     "rotation and an offset that it finds itself, without a "
                     "distance",
                     false});
  return {"imu1.yaml",
          fmt::format(
              "T_i_b:\n{}{}",
              RowsText(T_KB, ""),
              ImuText(own,
                      ChainNoiseText(
                          rig.imu1_noise, 1, imu1.time_offset_s, rate_hz, ""),
                      imu1.accel_position.size() > 0))};
}

void AddMatricesLoss(const Calibration& theta, std::vector<Loss>* losses) {
  if (IsNominal(theta.imu) && (!theta.imu1 || IsNominal(*theta.imu1))) return;
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
  const ChainFiles chain = ReadChainFiles(files, 2);
  ImportedRig result;
  const FoundImus imus = FindImus(chain, &result.losses);
  result.rig.imu_noise = ReadChainNoise(imus.reference);
  const ImuInBody body =
      FromMatrices(ReadMatrices("imu", "", imus.reference, &result.losses));
  result.rig.factory.imu = body.imu;
  if (imus.second) ReadSecondImu(*imus.second, body.R_IB, &result);
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
  const double rate_hz = ImuRate(options, "update_rate", &result.losses);
  const std::string imu =
      ImuText(body,
              ChainNoiseText(rig.imu_noise, 0, 0, rate_hz, ""),
              theta.imu.accel_position.size() > 0);
  AddMatricesLoss(theta, &result.losses);
  AddImuLosses("imu", theta.imu, body, &result.losses);
  AddGravityLoss("kalibr", rig, &result.losses);
  result.files = {{"camchain-imucam.yaml", chain}, {"imu.yaml", imu}};
  if (theta.imu1) {
    result.files.push_back(
        WriteSecondImu(rig, *theta.imu1, body.R_BI, rate_hz, &result.losses));
  }
  return result;
}

}  // namespace selfcal::client
