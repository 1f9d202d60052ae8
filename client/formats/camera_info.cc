#include "client/formats/camera_info.h"

#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <string_view>

#include "client/formats/format_error.h"
#include "client/formats/losses.h"
#include "client/formats/tool_models.h"
#include "client/formats/yaml_values.h"

namespace selfcal::client {
namespace {

constexpr char kCameraInfo[] = "camera_info";
constexpr char kEquidistant[] = "equidistant";

// All coefficients of the file, in the order of OpenCV; at least `count`.
Eigen::VectorXd ReadCoefficients(const YAML::Node& root, int count) {
  constexpr char kKey[] = "distortion_coefficients";
  const YAML::Node data = Get(Get(root, kKey), "data");
  if (!data.IsSequence()) {
    throw FormatError(fmt::format("field '{}' has no list of data", kKey));
  }
  const int present = static_cast<int>(data.size());
  Eigen::VectorXd values = GetMatrixData(root, kKey, present, 1);
  values.conservativeResize(std::max(count, present));
  values.tail(values.size() - present).setZero();
  if (!values.tail(values.size() - count).isZero(0)) {
    throw FormatError(fmt::format(
        "distortion_coefficients has {} values, of which selfcal has a model "
        "for {}: the others must be 0",
        present,
        count));
  }
  return values.head(count);
}

// Numbers of coefficients that the file has for a model.
int CountOf(const std::string& type) {
  if (type == "plumb_bob") return 5;
  return type == "rational_polynomial" ? 8 : 4;
}

// camera_calibration wrote "fisheye" before the name "equidistant" was agreed
// upon; files from before there were several models do not name theirs.
std::string ReadType(const YAML::Node& root) {
  if (!Has(root, "distortion_model")) return "plumb_bob";
  const std::string type = GetText(root, "distortion_model");
  return type == "fisheye" ? kEquidistant : type;
}

void ReadLens(const YAML::Node& root, CameraCalibration* camera) {
  const std::string type = ReadType(root);
  constexpr std::string_view kOrder[] = {
      "k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"};
  Eigen::VectorXd values;
  const auto is_zero = [&](const std::string& name) {
    if (values.size() == 0) values = ReadCoefficients(root, CountOf(type));
    for (Eigen::Index i = 0; i < values.size(); ++i) {
      if (kOrder[i] == name) return values[i] == 0;
    }
    return true;
  };
  const auto found = FindModel(kCameraInfo, type, {}, is_zero);
  if (!found) {
    throw FormatError(fmt::format("distortion_model '{}' is not one of {}",
                                  type,
                                  ToolModelNames(kCameraInfo)));
  }
  camera->model = found->model;
  camera->distortion =
      ReadCoefficients(root, CountOf(type)).head(DistortionSize(found->model));
}

// The rectified image is not that of the tracks, whose pixels are raw.
void AddRectificationLoss(const YAML::Node& root,
                          const std::string& camera,
                          std::vector<Loss>* losses) {
  const bool turned =
      Has(root, "rectification_matrix") &&
      !GetMatrixData(root, "rectification_matrix", 3, 3).isIdentity(0);
  const bool shifted =
      Has(root, "projection_matrix") &&
      !GetMatrixData(root, "projection_matrix", 3, 4).col(3).isZero(0);
  if (!turned && !shifted) return;
  losses->push_back(
      {camera + ".rectification",
       "rectification_matrix and projection_matrix are not used: selfcal needs "
       "the pixels of the raw image",
       false});
}

CameraCalibration ReadCamera(const TextFile& file,
                             const std::string& name,
                             std::vector<Loss>* losses) {
  const YAML::Node root = ParseYaml(file);
  CameraCalibration camera;
  camera.width_px = GetInt(root, "image_width");
  camera.height_px = GetInt(root, "image_height");
  const Eigen::Matrix3d K = GetMatrixData(root, "camera_matrix", 3, 3);
  const Eigen::Matrix3d pixels =
      (Eigen::Matrix3d() << K(0, 0), 0, K(0, 2), 0, K(1, 1), K(1, 2), 0, 0, 1)
          .finished();
  if (K != pixels) {
    throw FormatError(
        "camera_matrix is not [fx 0 cx; 0 fy cy; 0 0 1]: a skew has no place "
        "in selfcal");
  }
  camera.f = K.diagonal().head<2>();
  camera.c = K.topRightCorner<2, 1>();
  ReadLens(root, &camera);
  AddRectificationLoss(root, name, losses);
  return camera;
}

std::string MatrixText(const char* key, const Eigen::MatrixXd& M) {
  const Eigen::MatrixXd rows = M.transpose();  // stored column by column
  return fmt::format("{}:\n  rows: {}\n  cols: {}\n  data: {}\n",
                     key,
                     M.rows(),
                     M.cols(),
                     ListText({rows.data(), rows.data() + rows.size()}));
}

std::string CameraText(const CameraCalibration& camera,
                       const std::string& name) {
  const std::string type(FindToolModel(kCameraInfo, camera.model)->name);
  Eigen::RowVectorXd coefficients = Eigen::RowVectorXd::Zero(CountOf(type));
  coefficients.head(camera.distortion.size()) = camera.distortion.transpose();
  Eigen::Matrix<double, 3, 4> P = Eigen::Matrix<double, 3, 4>::Zero();
  P(0, 0) = camera.f.x();
  P(1, 1) = camera.f.y();
  P.block<2, 1>(0, 2) = camera.c;
  P(2, 2) = 1;
  return fmt::format("image_width: {}\nimage_height: {}\ncamera_name: {}\n",
                     camera.width_px,
                     camera.height_px,
                     name) +
         MatrixText("camera_matrix", P.leftCols<3>()) +
         fmt::format("distortion_model: {}\n", type) +
         MatrixText("distortion_coefficients", coefficients) +
         MatrixText("rectification_matrix", Eigen::Matrix3d::Identity()) +
         MatrixText("projection_matrix", P);
}

std::string Text(const Eigen::Quaterniond& q, const Eigen::Vector3d& p) {
  return fmt::format("translation {} {} {} m, rotation x y z w {} {} {} {}",
                     p.x(),
                     p.y(),
                     p.z(),
                     q.x(),
                     q.y(),
                     q.z(),
                     q.w());
}

void AddPoseLoss(const CameraCalibration& camera,
                 const std::string& name,
                 std::vector<Loss>* losses) {
  if (camera.p_CI.isZero(0) && camera.q_CI.vec().isZero(0)) return;
  losses->push_back(
      {name + ".extrinsics",
       fmt::format("camera_info has no poses: publish the IMU in the frame of "
                   "the camera as a transform of tf, {}",
                   Text(camera.q_CI, camera.p_CI)),
       true});
}

void AddRestOfRig(const Rig& rig,
                  const Calibration& theta,
                  std::vector<Loss>* losses) {
  if (!IsNominal(theta.imu)) {
    losses->push_back(
        {"imu",
         "camera_info has no IMU: correct its readings by CorrectImu with this "
         "calibration, both in frame I",
         true});
  }
  AddTimeOffsetLosses(kCameraInfo, theta, losses);
  AddLineDelayLosses(kCameraInfo, theta, losses);
  AddTimeDriftLosses(kCameraInfo, theta, losses);
  AddGravityLoss(kCameraInfo, rig, losses);
  losses->push_back({"imu_noise",
                     "camera_info has no IMU: `selfcal rig show` has its noise",
                     false});
}

}  // namespace

ImportedRig ImportCameraInfo(const std::vector<TextFile>& files,
                             const FormatOptions&) {
  ImportedRig result;
  for (std::size_t j = 0; j < files.size(); ++j) {
    const std::string name = fmt::format("cam{}", j);
    try {
      result.rig.factory.cameras.push_back(
          ReadCamera(files[j], name, &result.losses));
    } catch (const std::exception& error) {
      throw FormatError(fmt::format("{}: {}", name, error.what()));
    }
    result.losses.push_back(
        {name + ".extrinsics",
         "camera_info has no poses: the frame of the camera is taken for that "
         "of the IMU; state --extrinsics",
         true});
  }
  result.losses.push_back(
      {"imu_noise",
       "camera_info has no IMU: a usual noise is assumed; state --imu-preset "
       "or --gyro-noise, --accel-noise and so on",
       false});
  return result;
}

ExportedFiles ExportCameraInfo(const Rig& rig,
                               const Calibration& theta,
                               const FormatOptions&) {
  std::vector<CameraCalibration> cameras = theta.cameras;
  UseModelsOf(kCameraInfo, &cameras);
  ExportedFiles result;
  AddPinholeLosses(kCameraInfo, cameras, &result.losses, {kEquidistant});
  for (std::size_t j = 0; j < cameras.size(); ++j) {
    const std::string name = fmt::format("cam{}", j);
    AddPoseLoss(cameras[j], name, &result.losses);
    result.files.push_back({name + ".yaml", CameraText(cameras[j], name)});
  }
  AddRestOfRig(rig, theta, &result.losses);
  return result;
}

}  // namespace selfcal::client
