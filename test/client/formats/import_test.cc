// Files as the tools themselves write them, in forms that we do not: selfcal
// predicts from them what the tool does.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include "test/client/formats/loss_names.h"
#include "test/client/formats/predictions.h"

namespace selfcal::client {
namespace {

using Eigen::Matrix3d;
using Eigen::Matrix4d;
using testing::HasSubstr;

std::string Numbers(const Eigen::MatrixXd& M) {
  std::vector<double> values;
  for (Eigen::Index i = 0; i < M.rows(); ++i) {
    for (Eigen::Index j = 0; j < M.cols(); ++j) values.push_back(M(i, j));
  }
  return fmt::format("{}", fmt::join(values, ", "));
}

std::string Rows(const Eigen::MatrixXd& M) {
  std::vector<std::string> rows;
  for (Eigen::Index i = 0; i < M.rows(); ++i) {
    rows.push_back("[" + Numbers(M.row(i)) + "]");
  }
  return fmt::format("[{}]", fmt::join(rows, ", "));
}

Matrix4d RandomTransform(RandomValues* random) {
  Matrix4d T = Matrix4d::Identity();
  T.topLeftCorner<3, 3>() = random->Rotation().toRotationMatrix();
  T.topRightCorner<3, 1>() = random->Vector(3, 0.2);
  return T;
}

Matrix3d RandomLower(RandomValues* random) {
  Matrix3d M = Matrix3d::Identity();
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j <= i; ++j) M(i, j) += random->Uniform(-0.03, 0.03);
  }
  return M;
}

Matrix3d RandomSensitivity(RandomValues* random) {
  Matrix3d A;
  for (double& entry : A.reshaped()) entry = random->Uniform(-1e-3, 1e-3);
  return A;
}

constexpr char kNoise[] =
    "  accelerometer_noise_density: 0.01\n"
    "  accelerometer_random_walk: 0.0002\n"
    "  gyroscope_noise_density: 0.005\n"
    "  gyroscope_random_walk: 4.0e-06\n"
    "  update_rate: 200.0\n";

std::vector<TextFile> KalibrFiles(RandomValues* random) {
  const std::string chain = fmt::format(
      "cam0:\n"
      "  T_cam_imu: {}\n"
      "  cam_overlaps: [1]\n"
      "  camera_model: pinhole\n"
      "  distortion_coeffs: [0.01, -0.02, 0.003, -0.001]\n"
      "  distortion_model: equidistant\n"
      "  intrinsics: [190.9, 190.8, 254.9, 256.9]\n"
      "  resolution: [512, 512]\n"
      "  timeshift_cam_imu: 0.0056\n"
      "cam1:\n"
      "  T_cn_cnm1: {}\n"
      "  camera_model: pinhole\n"
      "  distortion_coeffs: [-0.28, 0.07, 0.0002, 0.00002]\n"
      "  distortion_model: radtan\n"
      "  intrinsics: [458, 457, 367, 248]\n"
      "  resolution: [752, 480]\n"
      "  timeshift_cam_imu: -0.0021\n",
      Rows(RandomTransform(random)),
      Rows(RandomTransform(random)));
  const std::string imu = fmt::format(
      "imu0:\n"
      "  T_i_b: {}\n"
      "{}"
      "  accelerometers:\n    M: {}\n"
      "  gyroscopes:\n    M: {}\n    A: {}\n    C_gyro_i: {}\n"
      "  model: scale-misalignment\n"
      "  time_offset: 0.0\n",
      Rows(Matrix4d::Identity()),
      kNoise,
      Rows(RandomLower(random)),
      Rows(RandomLower(random)),
      Rows(RandomSensitivity(random)),
      Rows(random->Rotation().toRotationMatrix()));
  return {{"camchain.yaml", chain}, {"imu.yaml", imu}};
}

std::vector<TextFile> OpenVinsFiles(RandomValues* random) {
  std::string chain = "%YAML:1.0\n\n";
  for (int j = 0; j < 2; ++j) {
    chain += fmt::format(
        "cam{}:\n"
        "  T_cam_imu: {}\n"
        "  camera_model: pinhole\n"
        "  distortion_coeffs: [-0.28, 0.07, 0.0002, 0.00002]\n"
        "  distortion_model: radtan\n"
        "  intrinsics: [458, 457, 367, 248]\n"
        "  resolution: [752, 480]\n"
        "  timeshift_cam_imu: 0.0056\n",
        j,
        Rows(RandomTransform(random)));
  }
  const std::string imu = fmt::format(
      "%YAML:1.0\n"
      "imu0:\n{}"
      "  model: \"kalibr\"\n"
      "  Tw: {}\n  R_IMUtoGYRO: {}\n  Ta: {}\n  R_IMUtoACC: {}\n  Tg: {}\n",
      kNoise,
      Rows(RandomLower(random)),
      Rows(random->Rotation().toRotationMatrix()),
      Rows(RandomLower(random)),
      Rows(random->Rotation().toRotationMatrix()),
      Rows(RandomSensitivity(random)));
  return {{"chain.yaml", chain}, {"imu.yaml", imu}};
}

std::vector<TextFile> OrbSlam3Files(RandomValues* random) {
  std::string text =
      "%YAML:1.0\n\n"
      "File.version: \"1.0\"\n"
      "Camera.type: \"PinHole\"\n";
  for (const int j : {1, 2}) {
    text += fmt::format(
        "Camera{0}.fx: 458.6\nCamera{0}.fy: 457.3\n"
        "Camera{0}.cx: 367.2\nCamera{0}.cy: 248.4\n"
        "Camera{0}.k1: -0.28\nCamera{0}.k2: 0.07\n"
        "Camera{0}.p1: 0.00019\nCamera{0}.p2: 1.76e-05\n",
        j);
  }
  const auto matrix = [](const Eigen::MatrixXd& M) {
    return fmt::format(
        "!!opencv-matrix\n   rows: 4\n   cols: 4\n   dt: f\n   data: [{}]\n",
        Numbers(M));
  };
  text += "Stereo.T_c1_c2: " + matrix(RandomTransform(random));
  text += "IMU.T_b_c1: " + matrix(RandomTransform(random));
  text +=
      "Camera.width: 752\nCamera.height: 480\nCamera.fps: 20\n"
      "IMU.NoiseGyro: 1.7e-04 # rad/s^0.5\nIMU.NoiseAcc: 2.0e-03\n"
      "IMU.GyroWalk: 1.9e-05\nIMU.AccWalk: 3.0e-03\nIMU.Frequency: 200.0\n";
  return {{"EuRoC.yaml", text}};
}

std::vector<TextFile> VinsFusionFiles(RandomValues* random) {
  std::string text =
      "%YAML:1.0\n\n#common parameters\nimu: 1         \nnum_of_cam: 2  \n"
      "cam0_calib: \"left.yaml\"\ncam1_calib: \"right.yaml\"\n"
      "image_width: 848\nimage_height: 800\n"
      "acc_n: 0.1          # deviation. #0.2   0.04\ngyr_n: 0.01\n"
      "acc_w: 0.001\ngyr_w: 0.0001\ng_norm: 9.805\ntd: -0.003\n";
  for (const int j : {0, 1}) {
    text += fmt::format(
        "body_T_cam{}: !!opencv-matrix\n   rows: 4\n   cols: 4\n   dt: d\n"
        "   data: [{}]\n",
        j,
        Numbers(RandomTransform(random)));
  }
  const std::string left =
      "%YAML:1.0\n---\nmodel_type: KANNALA_BRANDT\ncamera_name: camera\n"
      "image_width: 848\nimage_height: 800\nprojection_parameters:\n"
      "   k2: -0.007\n   k3: 0.0422\n   k4: -0.0399\n   k5: 0.00665\n"
      "   mu: 286.2\n   mv: 286.5\n   u0: 421.5\n   v0: 400.8\n";
  const std::string right =
      "%YAML:1.0\n---\nmodel_type: PINHOLE\ncamera_name: camera\n"
      "image_width: 848\nimage_height: 800\ndistortion_parameters:\n"
      "   k1: -0.29\n   k2: 0.083\n   p1: 2.4e-05\n   p2: -1.2e-04\n"
      "projection_parameters:\n"
      "   fx: 461\n   fy: 460\n   cx: 363\n   cy: 248\n";
  return {{"config.yaml", text}, {"left.yaml", left}, {"right.yaml", right}};
}

std::vector<TextFile> BasaltFiles(RandomValues* random) {
  std::string poses;
  for (const char* end : {",", ""}) {
    const Eigen::Quaterniond q = random->Rotation();
    poses += fmt::format(
        R"({{"px": 0.01, "py": -0.02, "pz": 0.05,
            "qx": {}, "qy": {}, "qz": {}, "qw": {}}}{})",
        q.x(),
        q.y(),
        q.z(),
        q.w(),
        end);
  }
  Eigen::VectorXd accel = random->Vector(9, 0.03);
  Eigen::VectorXd gyro = random->Vector(12, 0.03);
  accel.head<3>().setZero();
  gyro.head<3>().setZero();
  const std::string text = fmt::format(
      R"({{"value0": {{"T_imu_cam": [{}],
          "intrinsics": [
            {{"camera_type": "kb4", "intrinsics": {{
              "fx": 286.6, "fy": 286.5, "cx": 422.3, "cy": 395.2,
              "k1": -0.0067, "k2": 0.045, "k3": -0.0435, "k4": 0.0083}}}},
            {{"camera_type": "pinhole", "intrinsics": {{
              "fx": 460, "fy": 461, "cx": 420, "cy": 400}}}}],
          "resolution": [[848, 800], [848, 800]],
          "calib_accel_bias": [{}],
          "calib_gyro_bias": [{}],
          "imu_update_rate": 200.2,
          "accel_noise_std": [0.008, 0.008, 0.008],
          "gyro_noise_std": [0.002, 0.002, 0.002],
          "accel_bias_std": [0.01, 0.01, 0.01],
          "gyro_bias_std": [0.0007, 0.0007, 0.0007],
          "cam_time_offset_ns": 2124029, "vignette": []}}}})",
      poses,
      Numbers(accel.transpose()),
      Numbers(gyro.transpose()));
  return {{"calibration.json", text}};
}

// The cameras of a stereo rig as camera_calibration writes them.
std::vector<TextFile> CameraInfoFiles() {
  const std::string left =
      "image_width: 752\nimage_height: 480\ncamera_name: narrow_stereo/left\n"
      "camera_matrix:\n  rows: 3\n  cols: 3\n"
      "  data: [458.6, 0.0, 367.2, 0., 457.3, 248.4, 0, 0, 1]\n"
      "distortion_model: plumb_bob\n"
      "distortion_coefficients:\n  rows: 1\n  cols: 5\n"
      "  data: [-0.28, 0.07, 0.0002, 1.8e-05, 0.0]\n"
      "rectification_matrix:\n  rows: 3\n  cols: 3\n"
      "  data: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]\n"
      "projection_matrix:\n  rows: 3\n  cols: 4\n"
      "  data: [435.2, 0, 367.4, 0, 0, 435.2, 252.2, 0, 0, 0, 1, 0]\n";
  const std::string right =
      "image_width: 848\nimage_height: 800\ncamera_name: right\n"
      "camera_matrix:\n  rows: 3\n  cols: 3\n"
      "  data: [286.2, 0, 421.5, 0, 286.5, 400.8, 0, 0, 1]\n"
      "distortion_model: fisheye\n"
      "distortion_coefficients:\n  rows: 1\n  cols: 4\n"
      "  data: [-0.007, 0.0422, -0.0399, 0.00665]\n"
      "rectification_matrix:\n  rows: 3\n  cols: 3\n"
      "  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]\n"
      "projection_matrix:\n  rows: 3\n  cols: 4\n"
      "  data: [286.2, 0, 421.5, 0, 0, 286.5, 400.8, 0, 0, 0, 1, 0]\n";
  return {{"left.yaml", left}, {"right.yaml", right}};
}

std::vector<TextFile> Files(const std::string& format, RandomValues* random) {
  if (format == "kalibr") return KalibrFiles(random);
  if (format == "openvins") return OpenVinsFiles(random);
  if (format == "orb_slam3") return OrbSlam3Files(random);
  if (format == "vins_fusion") return VinsFusionFiles(random);
  if (format == "camera_info") return CameraInfoFiles();
  return BasaltFiles(random);
}

// The parts that a format lacks in its files above.
std::vector<std::string> Missing(const std::string& format) {
  if (format != "camera_info") return {};
  return {"cam0.extrinsics", "cam1.extrinsics", "imu_noise"};
}

class Import : public testing::TestWithParam<const char*> {};

TEST_P(Import, PredictsThePixelsRatesAndTimesOfTheTool) {
  constexpr double kRate_hz = 400;
  RandomValues random(3);
  for (int trial = 0; trial < 50; ++trial) {
    const std::vector<TextFile> files = Files(GetParam(), &random);
    const auto rig = ImportRig(GetParam(), files, {.imu_rate_hz = kRate_hz});
    ASSERT_TRUE(rig.ok()) << rig.status();
    EXPECT_EQ(Names(rig->losses), Missing(GetParam()));
    const Tool tool = ReadAsTool(GetParam(), files, kRate_hz);
    ExpectSamePredictions(rig->rig.factory, tool, &random);
    ExpectSameNoise(rig->rig.imu_noise, tool.noise);
    EXPECT_EQ(rig->rig.id, "");
  }
}

TEST_P(Import, WhatIsWrittenAgainSaysTheSame) {
  RandomValues random(4);
  const std::vector<TextFile> files = Files(GetParam(), &random);
  const auto rig = ImportRig(GetParam(), files, {.imu_rate_hz = 100});
  ASSERT_TRUE(rig.ok()) << rig.status();
  const auto again =
      ExportRig(GetParam(), rig->rig, rig->rig.factory, {.imu_rate_hz = 100});
  ASSERT_TRUE(again.ok()) << again.status();
  ExpectSamePredictions(
      rig->rig.factory, ReadAsTool(GetParam(), again->files, 100), &random);
}

// Each file with one line after the other missing: read, or refused in words.
TEST_P(Import, AFileThatIsCutOffIsRefusedInWords) {
  RandomValues random(5);
  std::vector<TextFile> files = Files(GetParam(), &random);
  int refused = 0;
  for (TextFile& file : files) {
    const std::string whole = file.text;
    for (std::size_t end = 0; end < whole.size(); end += 37) {
      file.text = whole.substr(0, end);
      const auto rig = ImportRig(GetParam(), files, {});
      if (rig.ok()) continue;
      ++refused;
      EXPECT_EQ(rig.status().code(), absl::StatusCode::kInvalidArgument);
      EXPECT_THAT(std::string(rig.status().message()), HasSubstr(file.name));
    }
    file.text = whole;
  }
  EXPECT_GT(refused, 10);
}

INSTANTIATE_TEST_SUITE_P(Formats,
                         Import,
                         testing::Values("kalibr",
                                         "openvins",
                                         "orb_slam3",
                                         "vins_fusion",
                                         "basalt",
                                         "camera_info"),
                         [](const auto& info) {
                           return std::string(info.param);
                         });

struct Change {
  const char* format;
  const char* from;
  const char* to;
  const char* answer;  // of an error, or the name of a loss
};

absl::StatusOr<ImportedRig> Changed(const Change& change) {
  RandomValues random(6);
  std::vector<TextFile> files = Files(change.format, &random);
  for (TextFile& file : files) {
    const std::size_t at = file.text.find(change.from);
    if (at == std::string::npos) continue;
    file.text.replace(at, std::string(change.from).size(), change.to);
    return ImportRig(change.format, files, {.imu_rate_hz = 200});
  }
  ADD_FAILURE() << change.from << " is in no file";
  return absl::InternalError("");
}

TEST(ImportErrors, NameTheFieldAndWhatToDo) {
  for (const Change& change : std::initializer_list<Change>{
           {"kalibr", "pinhole", "omni", "camera_model 'omni'"},
           {"kalibr", "equidistant", "equi", "distortion_model 'equi'"},
           {"kalibr", "T_cam_imu", "x", "camchain-imucam"},
           {"kalibr", "cam0", "x", "give two files"},
           {"kalibr", "[512, 512]", "[512]", "'resolution' needs 2"},
           {"kalibr", "190.9", ".nan", "'intrinsics' is not finite"},
           {"kalibr", "190.9", "-1", "must be positive"},
           {"kalibr", "time_offset: 0.0", "time_offset: 0.1", "time_offset"},
           {"kalibr", "gyroscope_noise", "x", "gyroscope_noise_density"},
           {"kalibr", "imu0:", "imu1: {}\nimu0:", "several IMUs"},
           {"openvins", "\"kalibr\"", "\"rpng\"", "not upper triangular"},
           {"openvins", "\"kalibr\"", "\"imu\"", "model 'imu'"},
           {"openvins", "T_cam_imu", "x", "'T_imu_cam' is missing"},
           {"openvins",
            "camera_model: pinhole",
            "camera_model: omni",
            "'intrinsics' needs 5"},
           {"orb_slam3", "PinHole", "Rectified", "Camera.type 'Rectified'"},
           {"orb_slam3", "File.version", "x", "File.version is missing"},
           {"orb_slam3", "Camera.width", "x", "'Camera.width' is missing"},
           {"vins_fusion", "imu: 1", "imu: 0", "imu is not 1"},
           {"vins_fusion", "left.yaml", "up.yaml", "up.yaml is missing"},
           {"vins_fusion", "KANNALA_BRANDT", "SCARAMUZZA", "'SCARAMUZZA'"},
           {"vins_fusion", "KANNALA_BRANDT", "MEI", "'mirror_parameters'"},
           {"vins_fusion", "num_of_cam: 2", "num_of_cam: 3", "not 1 or 2"},
           {"basalt", "kb4", "ds", "'xi' is missing"},
           {"basalt", "kb4", "fov", "one of pinhole-radtan8, kb4, eucm and ds"},
           {"basalt", "value0", "value1", "'value0' is missing"},
           {"basalt", "\"qw\": ", "\"qw\": 1", "norm"},
           {"basalt", "[848, 800]", "[848.5, 800]", "resolution"},
           {"basalt", "2124029", "\"soon\"", "cam_time_offset_ns"},
           {"camera_info",
            "plumb_bob",
            "thin_prism",
            "left.yaml right.yaml: cam0: distortion_model 'thin_prism' is not "
            "one of plumb_bob, equidistant and rational_polynomial"},
           {"camera_info", "458.6, 0.0", "458.6, 0.1", "a skew"},
           {"camera_info", "camera_matrix", "matrix", "'camera_matrix' is"},
           {"camera_info", "458.6", "0", "must be positive"},
           {"camera_info", "image_width: 752", "image_width: wide", "integer"},
           {"camera_info",
            "1.8e-05, 0.0]",
            "1.8e-05, 0, 0.1]",
            "has 6 values, of which selfcal has a model for 5"},
           {"camera_info",
            "data: [-0.28",
            "data: -0.28 #",
            "no list of data"}}) {
    const auto rig = Changed(change);
    EXPECT_EQ(rig.status().code(), absl::StatusCode::kInvalidArgument)
        << change.to;
    EXPECT_THAT(std::string(rig.status().message()), HasSubstr(change.answer));
  }
}

// A file is read as the smallest model that represents it.
TEST(ImportModels, AreTheSmallestThatRepresentTheFile) {
  constexpr char kEquidistant[] =
      "  distortion_coeffs: [0.01, -0.02, 0.003, -0.001]\n"
      "  distortion_model: equidistant\n"
      "  intrinsics: [190.9, 190.8, 254.9, 256.9]\n";
  constexpr char kFull[] =
      "%YAML:1.0\n---\nmodel_type: PINHOLE_FULL\nimage_width: 848\n"
      "image_height: 800\ndistortion_parameters: {k1: -0.2, k2: 0.1, p1: 0.0, "
      "p2: 0.0, ";
  constexpr char kPixels[] =
      "}\nprojection_parameters: {fx: 461, fy: 460, cx: 363, cy: 248}\n";
  const std::string full(kFull), pixels(kPixels);
  struct Case {
    const char* format;
    std::string from, to;
    const char* model;
  };
  RandomValues random(6);
  const std::string left = VinsFusionFiles(&random)[1].text;
  const std::string kb4 = R"("kb4", "intrinsics": {)";
  for (const Case& one : std::initializer_list<Case>{
           {"kalibr", "equidistant", "radtan", "radial-tangential"},
           {"kalibr",
            std::string("  camera_model: pinhole\n") + kEquidistant,
            "  camera_model: omni\n  distortion_coeffs: []\n"
            "  distortion_model: none\n"
            "  intrinsics: [0.9, 490.9, 490.8, 254.9, 256.9]\n",
            "unified"},
           {"kalibr",
            std::string("  camera_model: pinhole\n") + kEquidistant,
            "  camera_model: pinhole\n  distortion_coeffs: []\n"
            "  distortion_model: none\n"
            "  intrinsics: [490.9, 490.8, 254.9, 256.9]\n",
            "radial-tangential"},
           {"kalibr",
            std::string("  camera_model: pinhole\n") + kEquidistant,
            "  camera_model: eucm\n  distortion_coeffs: []\n"
            "  distortion_model: none\n"
            "  intrinsics: [0.6, 1.1, 190.9, 190.8, 254.9, 256.9]\n",
            "extended-unified"},
           {"kalibr",
            std::string("  camera_model: pinhole\n") + kEquidistant,
            "  camera_model: ds\n  distortion_coeffs: []\n"
            "  distortion_model: none\n"
            "  intrinsics: [-0.2, 0.59, 190.9, 190.8, 254.9, 256.9]\n",
            "double-sphere"},
           {"orb_slam3",
            "Camera1.fx",
            "Camera1.k3: 0\nCamera1.fx",
            "radial-tangential"},
           {"orb_slam3",
            "Camera1.fx",
            "Camera1.k3: 0.1\nCamera1.fx",
            "radial-tangential-5"},
           {"vins_fusion",
            left,
            full + "k3: 0, k4: 0, k5: 0, k6: 0" + pixels,
            "radial-tangential"},
           {"vins_fusion",
            left,
            full + "k3: 0.1, k4: 0, k5: 0, k6: 0" + pixels,
            "radial-tangential-5"},
           {"vins_fusion",
            left,
            full + "k3: 0, k4: 0, k5: 0.1, k6: 0" + pixels,
            "radial-tangential-8"},
           {"vins_fusion",
            left,
            "%YAML:1.0\n---\nmodel_type: MEI\nimage_width: 848\n"
            "image_height: 800\nmirror_parameters: {xi: 2.1}\n"
            "distortion_parameters: {k1: 0.02, k2: 1.6, p1: 0.0, p2: 0.0}\n"
            "projection_parameters: {gamma1: 1300, gamma2: 1301, u0: 420, "
            "v0: 400}\n",
            "unified"},
           {"basalt",
            kb4,
            R"("pinhole-radtan8", "intrinsics": {"p1": 0, "p2": 0, "k5": 0,
               "k6": 0, "rpmax": 0, )",
            "radial-tangential-8"},
           {"basalt",
            kb4,
            R"("ds", "intrinsics": {"xi": -0.2, "alpha": 0.6, )",
            "double-sphere"},
           {"basalt",
            kb4,
            R"("eucm", "intrinsics": {"alpha": 0.6, "beta": 1.1, )",
            "extended-unified"},
           {"camera_info", "1.8e-05, 0.0]", "1.8e-05]", "radial-tangential"},
           {"camera_info", "1.8e-05, 0.0]", "0, 0.1]", "radial-tangential-5"},
           {"camera_info",
            "distortion_model: plumb_bob\n",
            "",
            "radial-tangential"},
           {"camera_info",
            "plumb_bob\ndistortion_coefficients:\n  rows: 1\n  cols: 5\n"
            "  data: [-0.28, 0.07, 0.0002, 1.8e-05, 0.0]",
            "rational_polynomial\ndistortion_coefficients:\n"
            "  data: [0.3, 0.07, 0, 0, 0.01, 0.6, 0.1, 0.02, 0, 0, 0, 0]",
            "radial-tangential-8"},
           {"camera_info",
            "plumb_bob\ndistortion_coefficients:\n  rows: 1\n  cols: 5\n"
            "  data: [-0.28, 0.07, 0.0002, 1.8e-05, 0.0]",
            "rational_polynomial\ndistortion_coefficients:\n"
            "  data: [0.3, 0.07, 0, 0, 0.01, 0, 0, 0]",
            "radial-tangential-5"}}) {
    const Change change = {
        one.format, one.from.c_str(), one.to.c_str(), one.model};
    const auto rig = Changed(change);
    ASSERT_TRUE(rig.ok()) << rig.status() << " " << one.to;
    EXPECT_EQ(DistortionName(rig->rig.factory.cameras[0].model), one.model);
  }
}

TEST(ImportLosses, HaveAName) {
  for (const Change& change : std::initializer_list<Change>{
           {"openvins",
            "timeshift_cam_imu: 0.0056",
            "timeshift_cam_imu: 0.001",
            "cam1.timeshift_cam_imu"},
           {"basalt", "bias\": [0,", "bias\": [0.1,", "calib_accel_bias"},
           {"basalt", "\"vignette\": []", "\"vignette\": [1]", "vignette"},
           {"basalt",
            "[0.008, 0.008, 0.008]",
            "[0.008, 0.009, 0.008]",
            "accel_noise_std"}}) {
    const auto rig = Changed(change);
    ASSERT_TRUE(rig.ok()) << rig.status();
    ASSERT_EQ(rig->losses.size(), 1u) << change.answer;
    EXPECT_EQ(rig->losses[0].name, change.answer);
  }
}

TEST(ImportLosses, OfPositionsInKalibrHaveANameEach) {
  const auto rig = Changed(
      {"kalibr", "  gyroscopes:", "    rx_i: [0.01, 0, 0]\n  gyroscopes:", ""});
  ASSERT_TRUE(rig.ok()) << rig.status();
  EXPECT_THAT(
      Names(rig->losses),
      testing::ElementsAre("accelerometers.M", "imu.gyro.g_sensitivity"));
}

// Kalibr's result on several IMUs: one file.
TEST(ImportKalibr, ASecondImuIsReadAndAThirdOneIsLost) {
  RandomValues random(24);
  std::vector<TextFile> files = KalibrFiles(&random);
  const Matrix4d T_KB = RandomTransform(&random);
  files[1].text += fmt::format(
      "imu1:\n  T_i_b: {}\n{}  time_offset: 0.002\n", Rows(T_KB), kNoise);
  const auto rig = ImportRig("kalibr", files, {});
  ASSERT_TRUE(rig.ok()) << rig.status();
  ASSERT_TRUE(rig->rig.factory.imu1);
  EXPECT_NEAR(rig->rig.factory.imu1->p_JI.norm(),
              (T_KB.topRightCorner<3, 1>().norm()),
              1e-9);
  EXPECT_EQ(rig->rig.factory.imu1->time_offset_s, 0.002);
  EXPECT_EQ(Names(rig->losses), std::vector<std::string>{"imu1.T_i_b"});
  files[1].text += fmt::format("imu2:\n  T_i_b: {}\n{}", Rows(T_KB), kNoise);
  const auto three = ImportRig("kalibr", files, {});
  ASSERT_TRUE(three.ok()) << three.status();
  EXPECT_EQ(three->losses[0].name, "imu2");
}

TEST(ImportOpenVins, ASecondImuIsLost) {
  RandomValues random(25);
  std::vector<TextFile> files = OpenVinsFiles(&random);
  const auto one = ImportRig("openvins", files, {});
  ASSERT_TRUE(one.ok()) << one.status();
  EXPECT_THAT(Names(one->losses), testing::Not(testing::Contains("imu1")));
  const std::string imu = files[1].text;
  std::string second = imu.substr(imu.find("imu0:"));
  files[1].text += second.replace(0, 5, "imu1:");
  const auto two = ImportRig("openvins", files, {});
  ASSERT_TRUE(two.ok()) << two.status();
  ASSERT_THAT(Names(two->losses), testing::Contains("imu1"));
  EXPECT_TRUE(two->losses[0].changes_prediction);
  EXPECT_TRUE(BoxMinus(two->rig.factory, one->rig.factory).isZero(0));
}

// Tracks are in the raw image: its rectification says nothing about them.
TEST(ImportLosses, RectificationIsNotUsed) {
  for (const Change& change : std::initializer_list<Change>{
           {"camera_info",
            "[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]",
            "[1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0]",
            ""},
           {"camera_info", "367.4, 0, 0", "367.4, -47.9, 0", ""}}) {
    const auto rig = Changed(change);
    ASSERT_TRUE(rig.ok()) << rig.status();
    ASSERT_EQ(rig->losses.size(), 4u);
    EXPECT_EQ(rig->losses[0].name, "cam0.rectification");
    EXPECT_FALSE(rig->losses[0].changes_prediction);
  }
}

// The input of a calibration without an IMU model is in its result, whatever
// matrices it had.
TEST(ImportKalibr, IgnoresMatricesThatTheModelDoesNotHave) {
  const auto rig =
      Changed({"kalibr", "model: scale-misalignment", "model: calibrated", ""});
  ASSERT_TRUE(rig.ok()) << rig.status();
  const ImuCalibration& imu = rig->rig.factory.imu;
  EXPECT_TRUE(imu.T_g().isIdentity(0));
  EXPECT_TRUE(imu.T_a().isIdentity(0));
  EXPECT_TRUE(imu.q_AI.vec().isZero(0));
}

// Kalibr's input names no imu0.
TEST(ImportKalibr, ReadsTheImuOfAnInputAsWell) {
  RandomValues random(7);
  std::vector<TextFile> files = KalibrFiles(&random);
  const auto result = ImportRig("kalibr", files, {});
  ASSERT_TRUE(result.ok()) << result.status();
  files[1].text.replace(0, std::string("imu0:\n").size(), "");
  const auto input = ImportRig("kalibr", files, {});
  ASSERT_TRUE(input.ok()) << input.status();
  EXPECT_TRUE(BoxMinus(input->rig.factory, result->rig.factory).isZero(0));
}

TEST(ImportKalibr, ReadsThePositionOfTheAccelerometer) {
  RandomValues random(16);
  for (int trial = 0; trial < 20; ++trial) {
    std::vector<TextFile> files = KalibrFiles(&random);
    std::string& text = files[1].text;
    const std::size_t A = text.find("    A: ");
    text.replace(A, text.find('\n', A) - A, "    A: " + Rows(Matrix3d::Zero()));
    const Eigen::Vector3d r = random.Vector(3, 0.1);
    const std::string list = fmt::format("[{}, {}, {}]", r.x(), r.y(), r.z());
    text.insert(
        text.find("  gyroscopes:"),
        fmt::format("    rx_i: {0}\n    ry_i: {0}\n    rz_i: {0}\n", list));
    const auto rig = ImportRig("kalibr", files, {});
    ASSERT_TRUE(rig.ok()) << rig.status();
    EXPECT_TRUE(rig->losses.empty());
    EXPECT_EQ(rig->rig.factory.imu.accel_position.size(), 3);
    EXPECT_EQ(rig->rig.factory.imu.gyro_g_sensitivity.size(), 0);
    ExpectSamePredictions(
        rig->rig.factory, ReadAsTool("kalibr", files, 200), &random);
  }
}

// Basalt's constant bias, in terms of the readings, makes the same rates.
TEST(ImportLosses, ABiasIsToldAsCorrectImuTakesIt) {
  const auto rig =
      Changed({"basalt", "bias\": [0, 0, 0,", "bias\": [0.1, 0.2, 0.3,", ""});
  ASSERT_TRUE(rig.ok()) << rig.status();
  ASSERT_EQ(rig->losses.size(), 1u);
  const std::string& text = rig->losses[0].text;
  Eigen::Vector3d b_a;
  ASSERT_EQ(std::sscanf(text.substr(text.find("are ")).c_str(),
                        "are %lf %lf %lf",
                        &b_a.x(),
                        &b_a.y(),
                        &b_a.z()),
            3);
  const Eigen::Vector3d zero = Eigen::Vector3d::Zero();
  const ImuCalibration& imu = rig->rig.factory.imu;
  // f = (1 + M) accel - b: of a reading of 0 the rate is -b, of norm |b|.
  EXPECT_NEAR(CorrectImu(imu, zero, zero, zero, b_a).f_I.norm(),
              Eigen::Vector3d(0.1, 0.2, 0.3).norm(),
              1e-12);
}

}  // namespace
}  // namespace selfcal::client
