#include "test/client/formats/tools.h"

#include <yaml-cpp/yaml.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>
#include <initializer_list>
#include <nlohmann/json.hpp>
#include <stdexcept>

namespace selfcal::client {
namespace {

using Eigen::Matrix3d;
using Eigen::Matrix4d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Projection = std::function<Vector2d(const Vector3d& p_C)>;

// The rational model of OpenCV; coefficients that are left out are zero.
Vector2d RadTan(double x, double y, std::vector<double> k) {
  k.resize(8, 0);
  const double r = std::hypot(x, y);
  const double radial =
      (1 + k[0] * r * r + k[1] * std::pow(r, 4) + k[4] * std::pow(r, 6)) /
      (1 + k[5] * r * r + k[6] * std::pow(r, 4) + k[7] * std::pow(r, 6));
  return {x * radial + 2 * k[2] * x * y + k[3] * (r * r + 2 * x * x),
          y * radial + k[2] * (r * r + 2 * y * y) + 2 * k[3] * x * y};
}

// f_c follows the coefficients that stand before it.
Projection Camera(const std::string& model,
                  const std::vector<double>& f_c,
                  const std::vector<double>& k) {
  return [=](const Vector3d& p) -> Vector2d {
    const double x = p.x() / p.z();
    const double y = p.y() / p.z();
    const double r = std::hypot(x, y);
    double dx = x;
    double dy = y;
    if (model == "radtan") {
      const Vector2d d = RadTan(x, y, k);
      dx = d.x();
      dy = d.y();
    } else if (model == "omni") {
      const double z = p.z() + k[0] * p.norm();
      const Vector2d d = RadTan(p.x() / z, p.y() / z, {k.begin() + 1, k.end()});
      dx = d.x();
      dy = d.y();
    } else if (model == "eucm") {
      const double D =
          std::sqrt(k[1] * p.head<2>().squaredNorm() + p.z() * p.z());
      dx = p.x() / (k[0] * D + (1 - k[0]) * p.z());
      dy = p.y() / (k[0] * D + (1 - k[0]) * p.z());
    } else if (model == "ds") {
      const double z = p.z() + k[0] * p.norm();
      const double D = std::hypot(std::hypot(p.x(), p.y()), z);
      dx = p.x() / (k[1] * D + (1 - k[1]) * z);
      dy = p.y() / (k[1] * D + (1 - k[1]) * z);
    } else if (model == "kb") {  // at any angle
      const double t = std::atan2(p.head<2>().norm(), p.z());
      const double d = t + k[0] * std::pow(t, 3) + k[1] * std::pow(t, 5) +
                       k[2] * std::pow(t, 7) + k[3] * std::pow(t, 9);
      dx = p.x() * d / p.head<2>().norm();
      dy = p.y() * d / p.head<2>().norm();
    } else if (model == "equidistant") {  // of a pinhole
      if (p.z() <= 0) return {NAN, NAN};
      const double t = std::atan(r);
      const double d = t + k[0] * std::pow(t, 3) + k[1] * std::pow(t, 5) +
                       k[2] * std::pow(t, 7) + k[3] * std::pow(t, 9);
      dx = x * d / r;
      dy = y * d / r;
    } else if (model == "fov") {
      const double d = std::atan(2 * r * std::tan(k[0] / 2)) / k[0];
      dx = x * d / r;
      dy = y * d / r;
    } else {
      throw std::runtime_error("no such model: " + model);
    }
    return {f_c[0] * dx + f_c[2], f_c[1] * dy + f_c[3]};
  };
}

YAML::Node Yaml(const std::string& text) {
  const bool opencv = text.rfind("%YAML:1.0\n", 0) == 0;
  return YAML::Load(opencv ? text.substr(10) : text);
}

template <int N>
Eigen::Matrix<double, N, N> Mat(const YAML::Node& rows) {
  std::vector<double> all;
  for (const auto& row : rows) {
    if (row.IsScalar()) {
      all.push_back(row.as<double>());
      continue;
    }
    for (const auto& value : row) all.push_back(value.as<double>());
  }
  return Eigen::Map<Eigen::Matrix<double, N, N, Eigen::RowMajor>>(all.data());
}

std::vector<double> List(const YAML::Node& node) {
  return node.as<std::vector<double>>();
}

ToolCamera At(const Matrix4d& T_CB, const Projection& project, double offset) {
  return {[=](const Vector3d& p_B) -> Vector2d {
            return project((T_CB * p_B.homogeneous()).head<3>());
          },
          offset};
}

ToolRates AsTheyAre(const Vector3d& gyro, const Vector3d& accel) {
  return {gyro, accel};
}

std::string Name(const std::string& prefix, int j) {
  return prefix + std::to_string(j);
}

// aslam's projections; coefficients of omni, eucm and ds precede f and c.
Projection KalibrCamera(const YAML::Node& cam) {
  const auto model = cam["camera_model"].as<std::string>();
  const auto distortion = cam["distortion_model"].as<std::string>();
  std::vector<double> pixels = List(cam["intrinsics"]);
  std::vector<double> k(pixels.begin(), pixels.end() - 4);
  pixels.erase(pixels.begin(), pixels.end() - 4);
  for (const double value : List(cam["distortion_coeffs"])) k.push_back(value);
  if (model == "pinhole" && distortion == "none") {
    return Camera("radtan", pixels, k);
  }
  if (model == "omni") k.resize(5, 0);  // those of "none" are zero
  return Camera(model == "pinhole" ? distortion : model, pixels, k);
}

// Kalibr's wiki, "Yaml formats", and the residuals of its scale-misalignment
// model of the IMU. Rates in the frame of the IMU.
std::function<ToolRates(const Vector3d&, const Vector3d&)> KalibrRates(
    const YAML::Node& imu) {
  const Matrix3d Ma = Mat<3>(imu["accelerometers"]["M"]);
  const Matrix3d Mg = Mat<3>(imu["gyroscopes"]["M"]);
  const Matrix3d C = Mat<3>(imu["gyroscopes"]["C_gyro_i"]);
  if (!Ma.isLowerTriangular() || !Mg.isLowerTriangular()) {
    throw std::runtime_error("Kalibr's matrices are lower triangular");
  }
  const Matrix3d A = Mat<3>(imu["gyroscopes"]["A"]);
  Matrix3d r = Matrix3d::Zero();
  for (int axis = 0; axis < 3; ++axis) {
    const std::string key = std::string("r") + "xyz"[axis] + "_i";
    if (const YAML::Node node = imu["accelerometers"][key]) {
      for (int i = 0; i < 3; ++i) r(i, axis) = node[i].as<double>();
    }
  }
  // The rate is constant. Its forces are at the origin, so that A is exact only
  // where r is zero.
  return [=](const Vector3d& gyro, const Vector3d& accel) -> ToolRates {
    const Vector3d read = Ma.inverse() * accel;
    const Vector3d w = C.inverse() * (Mg.inverse() * (gyro - A * (C * read)));
    Vector3d f = read;
    for (int axis = 0; axis < 3; ++axis) {
      f[axis] -= w.cross(w.cross(r.col(axis)))[axis];
    }
    return {w, f};
  };
}

Tool Kalibr(const std::vector<TextFile>& files) {
  Tool tool;
  tool.has_imu_model = true;
  const YAML::Node chain = Yaml(files[0].text);
  // The input of Kalibr is the content of imu0 in its result.
  const YAML::Node root = Yaml(files[1].text);
  const YAML::Node imu = root["imu0"] ? root["imu0"] : root;
  tool.correct = KalibrRates(imu);
  if (files.size() > 2) {
    const YAML::Node second = Yaml(files[2].text);
    const Matrix4d T_KB = Mat<4>(second["T_i_b"]);
    const Matrix3d R_BK = T_KB.topLeftCorner<3, 3>().transpose();
    const Vector3d r_B = -R_BK * T_KB.topRightCorner<3, 1>();
    const auto rates = KalibrRates(second);
    tool.correct_second = [=](const Vector3d& gyro, const Vector3d& accel) {
      const ToolRates at_K = rates(gyro, accel);
      const Vector3d w_B = R_BK * at_K.w_B;
      return ToolRates{w_B, R_BK * at_K.f_B - w_B.cross(w_B.cross(r_B))};
    };
  }
  tool.noise = {
      .gyro_noise_density = imu["gyroscope_noise_density"].as<double>(),
      .accel_noise_density = imu["accelerometer_noise_density"].as<double>(),
      .gyro_bias_random_walk = imu["gyroscope_random_walk"].as<double>(),
      .accel_bias_random_walk = imu["accelerometer_random_walk"].as<double>()};
  Matrix4d T_CB = Matrix4d::Identity();
  for (int j = 0; chain[Name("cam", j)]; ++j) {
    const YAML::Node cam = chain[Name("cam", j)];
    // By the chain where it has one, to see that both say the same.
    T_CB = j > 0 ? (Mat<4>(cam["T_cn_cnm1"]) * T_CB).eval()
                 : Mat<4>(cam["T_cam_imu"]);
    if (cam["T_cam_imu"] && !Mat<4>(cam["T_cam_imu"]).isApprox(T_CB, 1e-9)) {
      throw std::runtime_error("the chain contradicts itself");
    }
    tool.cameras.push_back(
        At(T_CB, KalibrCamera(cam), cam["timeshift_cam_imu"].as<double>()));
  }
  return tool;
}

// VioManagerOptions (how files are read), Propagator (how readings are
// corrected): D = T^-1, of which only a triangle is kept.
Tool OpenVins(const std::vector<TextFile>& files) {
  Tool tool;
  tool.has_imu_model = true;
  const YAML::Node chain = Yaml(files[0].text);
  const YAML::Node imu = Yaml(files[1].text)["imu0"];
  Matrix3d Dw = Mat<3>(imu["Tw"]).inverse();
  Matrix3d Da = Mat<3>(imu["Ta"]).inverse();
  if (imu["model"].as<std::string>() == "rpng") {
    Dw = Dw.triangularView<Eigen::Upper>().toDenseMatrix().eval();
    Da = Da.triangularView<Eigen::Upper>().toDenseMatrix().eval();
  } else {
    Dw = Dw.triangularView<Eigen::Lower>().toDenseMatrix().eval();
    Da = Da.triangularView<Eigen::Lower>().toDenseMatrix().eval();
  }
  const Matrix3d R_GYROtoIMU = Mat<3>(imu["R_IMUtoGYRO"]).transpose();
  const Matrix3d R_ACCtoIMU = Mat<3>(imu["R_IMUtoACC"]).transpose();
  const Matrix3d Tg = Mat<3>(imu["Tg"]);
  tool.correct = [=](const Vector3d& gyro, const Vector3d& accel) -> ToolRates {
    const Vector3d f = R_ACCtoIMU * Da * accel;
    return {R_GYROtoIMU * Dw * (gyro - Tg * f), f};
  };
  tool.noise = {
      .gyro_noise_density = imu["gyroscope_noise_density"].as<double>(),
      .accel_noise_density = imu["accelerometer_noise_density"].as<double>(),
      .gyro_bias_random_walk = imu["gyroscope_random_walk"].as<double>(),
      .accel_bias_random_walk = imu["accelerometer_random_walk"].as<double>()};
  const double offset = chain["cam0"]["timeshift_cam_imu"].as<double>();
  for (int j = 0; chain[Name("cam", j)]; ++j) {
    const YAML::Node cam = chain[Name("cam", j)];
    const Matrix4d T_CB = cam["T_imu_cam"]
                              ? Mat<4>(cam["T_imu_cam"]).inverse().eval()
                              : Mat<4>(cam["T_cam_imu"]);
    const auto model = cam["distortion_model"].as<std::string>();
    tool.cameras.push_back(At(T_CB,
                              Camera(model == "equidistant" ? model : "radtan",
                                     List(cam["intrinsics"]),
                                     List(cam["distortion_coeffs"])),
                              offset));
  }
  return tool;
}

// Settings.cc of version 1.0: Tbc, Tlr, continuous-time noise (Tracking.cc
// multiplies by the root of IMU.Frequency).
Tool OrbSlam3(const std::vector<TextFile>& files) {
  Tool tool;
  const YAML::Node root = Yaml(files[0].text);
  tool.correct = AsTheyAre;
  tool.noise = {.gyro_noise_density = root["IMU.NoiseGyro"].as<double>(),
                .accel_noise_density = root["IMU.NoiseAcc"].as<double>(),
                .gyro_bias_random_walk = root["IMU.GyroWalk"].as<double>(),
                .accel_bias_random_walk = root["IMU.AccWalk"].as<double>()};
  const bool pinhole = root["Camera.type"].as<std::string>() == "PinHole";
  for (const char* matrix : {"IMU.T_b_c1", "Stereo.T_c1_c2"}) {
    if (root[matrix] && root[matrix]["dt"].as<std::string>() != "f") {
      throw std::runtime_error("its elements are read as floats");
    }
  }
  Matrix4d T_BC = Mat<4>(root["IMU.T_b_c1"]["data"]);
  for (const int j : {1, 2}) {
    const auto value = [&](const char* key) {
      return root[Name("Camera", j) + "." + key].as<double>();
    };
    if (!root[Name("Camera", j) + ".fx"]) break;
    if (j == 2) T_BC = T_BC * Mat<4>(root["Stereo.T_c1_c2"]["data"]);
    std::vector<double> k =
        pinhole
            ? std::vector{value("k1"), value("k2"), value("p1"), value("p2")}
            : std::vector{value("k1"), value("k2"), value("k3"), value("k4")};
    if (pinhole && root[Name("Camera", j) + ".k3"]) k.push_back(value("k3"));
    tool.cameras.push_back(
        At(T_BC.inverse(),
           Camera(pinhole ? "radtan" : "kb",
                  {value("fx"), value("fy"), value("cx"), value("cy")},
                  k),
           0));
  }
  return tool;
}

// Its configurations, integration_base.h and camodocal's EquidistantCamera,
// PinholeFullCamera and CataCamera. A
// reading has the standard deviation acc_n; in a step dt a bias moves by acc_w
// dt.
Tool VinsFusion(const std::vector<TextFile>& files, double rate_hz) {
  Tool tool;
  const YAML::Node root = Yaml(files[0].text);
  tool.correct = AsTheyAre;
  const double dt = 1 / rate_hz;
  const auto noise = [&](const char* key) { return root[key].as<double>(); };
  tool.noise = {.gyro_noise_density = noise("gyr_n") * std::sqrt(dt),
                .accel_noise_density = noise("acc_n") * std::sqrt(dt),
                .gyro_bias_random_walk = noise("gyr_w") * dt / std::sqrt(dt),
                .accel_bias_random_walk = noise("acc_w") * dt / std::sqrt(dt)};
  for (int j = 0; j < root["num_of_cam"].as<int>(); ++j) {
    const auto name = root[Name("cam", j) + "_calib"].as<std::string>();
    YAML::Node cam;
    for (const TextFile& file : files) {
      if (file.name == name) cam = Yaml(file.text);
    }
    const YAML::Node p = cam["projection_parameters"];
    const YAML::Node d = cam["distortion_parameters"];
    const auto values = [](const YAML::Node& node,
                           std::initializer_list<const char*> names) {
      std::vector<double> list;
      for (const char* key : names) list.push_back(node[key].as<double>());
      return list;
    };
    const auto type = cam["model_type"].as<std::string>();
    Projection project =
        Camera("kb",
               type == "KANNALA_BRANDT" ? values(p, {"mu", "mv", "u0", "v0"})
                                        : std::vector<double>(),
               type == "KANNALA_BRANDT" ? values(p, {"k2", "k3", "k4", "k5"})
                                        : std::vector<double>());
    if (type == "PINHOLE" || type == "PINHOLE_FULL") {
      std::vector<double> k = values(d, {"k1", "k2", "p1", "p2"});
      if (type == "PINHOLE_FULL") {
        for (const double rest : values(d, {"k3", "k4", "k5", "k6"})) {
          k.push_back(rest);
        }
      }
      project = Camera("radtan", values(p, {"fx", "fy", "cx", "cy"}), k);
    } else if (type == "MEI") {
      std::vector<double> k = values(cam["mirror_parameters"], {"xi"});
      for (const double rest : values(d, {"k1", "k2", "p1", "p2"})) {
        k.push_back(rest);
      }
      project = Camera("omni", values(p, {"gamma1", "gamma2", "u0", "v0"}), k);
    }
    tool.cameras.push_back(
        At(Mat<4>(root[Name("body_T_cam", j)]["data"]).inverse(),
           project,
           root["td"].as<double>()));
  }
  return tool;
}

// calib_bias.hpp, calibration.hpp, headers_serialization.h and the cameras of
// basalt-headers.
Tool Basalt(const std::vector<TextFile>& files) {
  Tool tool;
  tool.has_imu_model = true;
  const auto root = nlohmann::json::parse(files[0].text)["value0"];
  const std::vector<double> a = root["calib_accel_bias"];
  const std::vector<double> g = root["calib_gyro_bias"];
  Matrix3d Sa;
  Sa << a[3], 0, 0, a[4], a[6], 0, a[5], a[7], a[8];
  Matrix3d Sg;
  Sg << g[3], g[6], g[9], g[4], g[7], g[10], g[5], g[8], g[11];
  tool.correct = [=](const Vector3d& gyro, const Vector3d& accel) -> ToolRates {
    return {gyro + Sg * gyro, accel + Sa * accel};
  };
  tool.noise = {.gyro_noise_density = root["gyro_noise_std"][0],
                .accel_noise_density = root["accel_noise_std"][0],
                .gyro_bias_random_walk = root["gyro_bias_std"][0],
                .accel_bias_random_walk = root["accel_bias_std"][0]};
  for (std::size_t j = 0; j < root["T_imu_cam"].size(); ++j) {
    const auto& T = root["T_imu_cam"][j];
    Eigen::Isometry3d T_BC = Eigen::Isometry3d::Identity();
    T_BC.linear() = Eigen::Quaterniond(T["qw"], T["qx"], T["qy"], T["qz"])
                        .toRotationMatrix();
    T_BC.translation() = Vector3d(T["px"], T["py"], T["pz"]);
    const std::string type = root["intrinsics"][j]["camera_type"];
    const auto& p = root["intrinsics"][j]["intrinsics"];
    std::string model = "radtan";
    std::vector<double> k = {0, 0, 0, 0};
    if (type == "kb4") {
      model = "kb";
      k = {p["k1"], p["k2"], p["k3"], p["k4"]};
    } else if (type == "eucm") {
      model = type;
      k = {p["alpha"], p["beta"]};
    } else if (type == "ds") {
      model = type;
      k = {p["xi"], p["alpha"]};
    } else if (type == "pinhole-radtan8") {
      if (p["rpmax"] != 0) throw std::runtime_error("has a limit");
      k = {p["k1"],
           p["k2"],
           p["p1"],
           p["p2"],
           p["k3"],
           p["k4"],
           p["k5"],
           p["k6"]};
    }
    tool.cameras.push_back(
        At(T_BC.inverse().matrix(),
           Camera(model, {p["fx"], p["fy"], p["cx"], p["cy"]}, k),
           1e-9 * root["cam_time_offset_ns"].get<double>()));
  }
  return tool;
}

// imu.cc and the example calibrations of maplab; its recordings reproject so.
Tool Maplab(const std::vector<TextFile>& files) {
  Tool tool;
  tool.correct = AsTheyAre;
  const YAML::Node root = Yaml(files[0].text);
  for (const auto& sensor : root["sensors"]) {
    const auto type = sensor["sensor_type"].as<std::string>();
    if (type == "IMU") {
      const auto value = [&](const char* key) {
        return sensor["sigmas"][key].as<double>();
      };
      tool.noise = {
          .gyro_noise_density = value("gyro_noise_density"),
          .accel_noise_density = value("acc_noise_density"),
          .gyro_bias_random_walk = value("gyro_bias_random_walk_noise_density"),
          .accel_bias_random_walk =
              value("acc_bias_random_walk_noise_density")};
    }
    if (type != "NCAMERA") continue;
    for (const auto& entry : sensor["cameras"]) {
      const auto cam = entry["camera"];
      auto model = cam["distortion"]["type"].as<std::string>();
      if (model == "fisheye") model = "fov";
      if (model == "radial-tangential") model = "radtan";
      std::vector<double> k = List(cam["distortion"]["parameters"]["data"]);
      std::vector<double> pixels = List(cam["intrinsics"]["data"]);
      if (cam["type"].as<std::string>() == "unified-projection") {
        if (model != "radtan") throw std::runtime_error("is not tested");
        model = "omni";
        k.insert(k.begin(), pixels.front());
        pixels.erase(pixels.begin());
      }
      tool.cameras.push_back(At(Mat<4>(entry["T_B_C"]["data"]).inverse(),
                                Camera(model, pixels, k),
                                0));
    }
  }
  return tool;
}

// image_geometry's PinholeCameraModel, by OpenCV's projectPoints and
// fisheye::projectPoints with K and D of a camera in the optical frame.
Tool CameraInfo(const std::vector<TextFile>& files) {
  Tool tool;
  tool.correct = AsTheyAre;
  for (const TextFile& file : files) {
    const YAML::Node root = Yaml(file.text);
    const auto type = root["distortion_model"].as<std::string>();
    const std::vector<double> K = List(root["camera_matrix"]["data"]);
    const std::vector<double> D = List(root["distortion_coefficients"]["data"]);
    const bool fisheye = type == "equidistant" || type == "fisheye";
    tool.cameras.push_back(At(Matrix4d::Identity(),
                              Camera(fisheye ? "equidistant" : "radtan",
                                     {K.at(0), K.at(4), K.at(2), K.at(5)},
                                     D),
                              0));
  }
  return tool;
}

}  // namespace

Tool ReadAsTool(const std::string& format,
                const std::vector<TextFile>& files,
                double imu_rate_hz) {
  if (format == "kalibr") return Kalibr(files);
  if (format == "openvins") return OpenVins(files);
  if (format == "orb_slam3") return OrbSlam3(files);
  if (format == "vins_fusion") return VinsFusion(files, imu_rate_hz);
  if (format == "basalt") return Basalt(files);
  if (format == "camera_info") return CameraInfo(files);
  return Maplab(files);
}

}  // namespace selfcal::client
