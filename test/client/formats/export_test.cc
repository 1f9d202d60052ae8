// Files that are written: each tool predicts from them what selfcal does, and
// they read back as what they were written from.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include <algorithm>
#include <array>
#include <regex>

#include "test/client/formats/loaders.h"
#include "test/client/formats/loss_names.h"
#include "test/client/formats/predictions.h"

namespace selfcal::client {
namespace {

using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using Model = DistortionModel;

constexpr double kRate_hz = 250;
constexpr FormatOptions kOptions{.imu_rate_hz = kRate_hz};

Model ModelNamed(std::string_view name) {
  for (const Model model : DistortionModels()) {
    if (DistortionName(model) == name) return model;
  }
  throw std::out_of_range(std::string(name));
}

struct Expressible {
  const char* format;
  std::vector<Model> models;
  std::size_t cameras;
  bool same_model;    // of all cameras
  bool imu;           // its scales, misalignments, rotation
  bool time_offset;   // any
  bool time_offsets;  // one for each camera
  bool g_sensitivity = false;
  double least_w = 0;  // of a FOV camera, in magnitude
  bool poses = true;   // of cameras
  bool noise = true;   // of the IMU
};

const Model kRadialTangential5 = ModelNamed("radial-tangential-5");
const Model kRadialTangential8 = ModelNamed("radial-tangential-8");
const Model kUnified = ModelNamed("unified");
const Model kExtendedUnified = ModelNamed("extended-unified");
const Model kDoubleSphere = ModelNamed("double-sphere");

const Expressible kExpressible[] = {
    {"kalibr",
     {Model::kFov,
      Model::kRadialTangential,
      Model::kEquidistant,
      kUnified,
      kExtendedUnified,
      kDoubleSphere},
     4,
     false,
     true,
     true,
     true,
     true},
    {"openvins",
     {Model::kRadialTangential, Model::kEquidistant},
     4,
     false,
     true,
     true,
     false,
     true},
    {"orb_slam3",
     {Model::kRadialTangential, kRadialTangential5, Model::kEquidistant},
     2,
     true,
     false,
     false,
     false},
    {"vins_fusion",
     {Model::kRadialTangential,
      kRadialTangential5,
      kRadialTangential8,
      Model::kEquidistant,
      kUnified},
     2,
     false,
     false,
     true,
     false},
    {"basalt",
     {Model::kRadialTangential,
      kRadialTangential5,
      kRadialTangential8,
      Model::kEquidistant,
      kExtendedUnified,
      kDoubleSphere},
     4,
     false,
     true,
     true,
     false},
    {"maplab",
     {Model::kFov, Model::kRadialTangential, Model::kEquidistant, kUnified},
     4,
     false,
     false,
     false,
     false,
     false,
     0.5},
    {"camera_info",
     {Model::kRadialTangential,
      kRadialTangential5,
      kRadialTangential8,
      Model::kEquidistant},
     4,
     false,
     false,
     false,
     false,
     false,
     0,
     false,
     false}};

// Cameras where a format without poses has them.
void Place(const Expressible& format, Rig* rig) {
  if (format.poses) return;
  for (CameraCalibration& camera : rig->factory.cameras) {
    camera.q_CI.setIdentity();
    camera.p_CI.setZero();
  }
}

std::size_t Pick(std::size_t count, RandomValues* random) {
  return std::min(count - 1,
                  static_cast<std::size_t>(random->Uniform(0, 1) *
                                           static_cast<double>(count)));
}

// A rig that a format has words for, but for its IMU.
Rig RandomRig(const Expressible& format, RandomValues* random) {
  Rig rig;
  rig.id = "device";
  rig.factory = random->Theta();
  rig.factory.cameras.clear();
  if (format.noise) {
    rig.imu_noise = {.gyro_noise_density = random->Uniform(1e-4, 1e-3),
                     .accel_noise_density = random->Uniform(1e-3, 1e-2),
                     .gyro_bias_random_walk = random->Uniform(1e-6, 1e-4),
                     .accel_bias_random_walk = random->Uniform(1e-5, 1e-3)};
  }
  if (format.g_sensitivity) {
    rig.factory.imu.gyro_g_sensitivity = random->Vector(9, 1e-3);
  }
  const std::size_t cameras = 1 + Pick(format.cameras, random);
  const Model model = format.models[Pick(format.models.size(), random)];
  for (std::size_t j = 0; j < cameras; ++j) {
    CameraCalibration camera = random->Camera(
        format.same_model ? model
                          : format.models[Pick(format.models.size(), random)]);
    if (camera.model == Model::kFov) {
      camera.distortion[0] = std::copysign(
          std::max(std::abs(camera.distortion[0]), format.least_w),
          camera.distortion[0]);
    }
    if (format.time_offset) {
      // Basalt has whole nanoseconds.
      camera.time_offset_s = std::round(random->Uniform(-3e7, 3e7)) / 1e9;
    }
    if (!format.time_offsets && j > 0) {
      camera.time_offset_s = rig.factory.cameras[0].time_offset_s;
    }
    rig.factory.cameras.push_back(camera);
  }
  Place(format, &rig);
  return rig;
}

class Export : public testing::TestWithParam<Expressible> {};

TEST_P(Export, TheToolPredictsTheSamePixelsRatesAndTimes) {
  RandomValues random(7);
  for (int trial = 0; trial < 50; ++trial) {
    const Rig rig = RandomRig(GetParam(), &random);
    const auto files = ExportRig(GetParam().format, rig, rig.factory, kOptions);
    ASSERT_TRUE(files.ok()) << files.status();
    const Tool tool = ReadAsTool(GetParam().format, files->files, kRate_hz);
    EXPECT_EQ(tool.has_imu_model, GetParam().imu);
    ExpectSamePredictions(rig.factory, tool, &random);
    ExpectSameNoise(tool.noise, rig.imu_noise);
  }
}

TEST_P(Export, TheLoaderOfTheToolReadsEveryKey) {
  RandomValues random(13);
  for (int trial = 0; trial < 50; ++trial) {
    const Rig rig = RandomRig(GetParam(), &random);
    const auto files = ExportRig(GetParam().format, rig, rig.factory, kOptions);
    ASSERT_TRUE(files.ok()) << files.status();
    EXPECT_THAT(LoaderFaults(GetParam().format, files->files), IsEmpty());
  }
}

TEST_P(Export, ReadsBackAsItWas) {
  RandomValues random(8);
  for (int trial = 0; trial < 50; ++trial) {
    Rig rig = RandomRig(GetParam(), &random);
    const auto files = ExportRig(GetParam().format, rig, rig.factory, kOptions);
    ASSERT_TRUE(files.ok()) << files.status();
    const auto again = ImportRig(GetParam().format, files->files, kOptions);
    ASSERT_TRUE(again.ok()) << again.status();
    // The parts that a format lacks are said to be missing when it is read.
    std::vector<std::string> missing;
    for (std::size_t j = 0; j < rig.factory.cameras.size(); ++j) {
      if (!GetParam().poses)
        missing.push_back(fmt::format("cam{}.extrinsics", j));
    }
    if (!GetParam().noise) missing.emplace_back("imu_noise");
    EXPECT_EQ(Names(again->losses), missing);
    if (!GetParam().imu) rig.factory.imu = {};
    for (CameraCalibration& camera : rig.factory.cameras) {
      if (camera.model == Model::kFov) {
        camera.distortion = camera.distortion.cwiseAbs();
      }
    }
    ASSERT_TRUE(SameShape(again->rig.factory, rig.factory));
    EXPECT_LT(BoxMinus(again->rig.factory, rig.factory).cwiseAbs().maxCoeff(),
              1e-9);
    for (std::size_t j = 0; j < rig.factory.cameras.size(); ++j) {
      EXPECT_EQ(again->rig.factory.cameras[j].width_px, 640);
      EXPECT_EQ(again->rig.factory.cameras[j].height_px, 480);
    }
    ExpectSameNoise(again->rig.imu_noise, rig.imu_noise);
  }
}

TEST_P(Export, WhatTheToolCannotSayHasAName) {
  RandomValues random(9);
  Rig rig = RandomRig(GetParam(), &random);
  const std::string format = GetParam().format;
  rig.factory.cameras.assign(3, random.Camera(Model::kEquidistant));
  rig.factory.cameras[0].time_offset_s = 0.003;
  rig.factory.cameras[1].time_offset_s = 0.004;
  rig.factory.cameras[2].time_offset_s = 0.003;
  rig.factory.cameras[1].line_delay_s = 3e-5;
  rig.factory.cameras[1].time_drift = 2e-5;
  const auto files = ExportRig(format, rig, rig.factory, {});
  ASSERT_TRUE(files.ok()) << files.status();
  const std::vector<std::string> names = Names(files->losses);
  const auto named = [&](const std::string& name) {
    return std::count(names.begin(), names.end(), name) == 1;
  };
  EXPECT_EQ(named("imu"), !GetParam().imu);
  EXPECT_EQ(named("cam0.time_offset"), !GetParam().time_offset);
  EXPECT_EQ(named("cam1.time_offset"), !GetParam().time_offsets);
  EXPECT_EQ(named("cam2.time_offset"),
            !GetParam().time_offset && GetParam().cameras > 2);
  EXPECT_EQ(named("cam1.line_delay"), format != "maplab");
  EXPECT_FALSE(named("cam0.line_delay"));
  EXPECT_TRUE(named("cam1.time_drift"));
  EXPECT_EQ(named("cam2"), GetParam().cameras < 3);
  EXPECT_EQ(named("cam0.extrinsics"), !GetParam().poses);
  EXPECT_EQ(named("imu_noise"), !GetParam().noise);
  EXPECT_EQ(named("imu_rate"), format != "maplab" && GetParam().noise);
  EXPECT_TRUE(named("sigmas"));
  for (const Loss& loss : files->losses) {
    EXPECT_EQ(loss.changes_prediction,
              loss.name == "imu" || loss.name.rfind("cam", 0) == 0)
        << loss.name;
  }
}

TEST_P(Export, DelaysOfZeroAreNoLoss) {
  RandomValues random(23);
  Rig rig = RandomRig(GetParam(), &random);
  for (CameraCalibration& camera : rig.factory.cameras) {
    camera.line_delay_s = 0;
    camera.time_drift = 0;
  }
  const auto files = ExportRig(GetParam().format, rig, rig.factory, {});
  ASSERT_TRUE(files.ok()) << files.status();
  EXPECT_THAT(Names(files->losses),
              Not(testing::AnyOf(Contains("cam0.line_delay"),
                                 Contains("cam0.time_drift"))));
}

TEST_P(Export, SlopesAreNamedAndTheValuesAreThoseOfTheReference) {
  RandomValues random(19);
  Rig rig = RandomRig(GetParam(), &random);
  const auto plain = ExportRig(GetParam().format, rig, rig.factory, {});
  ASSERT_TRUE(plain.ok()) << plain.status();
  rig.factory.imu.s_g_slope = Eigen::Vector3d(1e-4, 2e-4, 3e-4);
  rig.factory.cameras[0].f_slope = Eigen::Vector2d(0.02, 0.03);
  const auto files = ExportRig(GetParam().format, rig, rig.factory, {});
  ASSERT_TRUE(files.ok()) << files.status();
  const std::vector<std::string> names = Names(files->losses);
  EXPECT_EQ(std::count(names.begin(), names.end(), "slopes"), 1);
  ASSERT_EQ(files->files.size(), plain->files.size());
  for (std::size_t i = 0; i < files->files.size(); ++i) {
    EXPECT_EQ(files->files[i].text, plain->files[i].text);
  }
}

TEST_P(Export, OptionalBlocksOfTheImuAreWrittenOrNamed) {
  RandomValues random(20);
  Rig rig = RandomRig(GetParam(), &random);
  const std::string format = GetParam().format;
  const auto count = [&](const std::string& name) {
    const auto files = ExportRig(format, rig, rig.factory, kOptions);
    EXPECT_TRUE(files.ok()) << files.status();
    const std::vector<std::string> names = Names(files->losses);
    return std::count(names.begin(), names.end(), name);
  };
  rig.factory.imu.gyro_g_sensitivity = random.Vector(9, 1e-3);
  rig.factory.imu.accel_position = random.Vector(3, 0.05);
  if (!GetParam().imu) {
    rig.factory.imu.s_g = rig.factory.imu.s_a = Eigen::Vector3d::Ones();
    rig.factory.imu.m_g = rig.factory.imu.m_a = Eigen::Vector3d::Zero();
    rig.factory.imu.q_AI.setIdentity();
    EXPECT_EQ(count("imu"), 1);
    return;
  }
  // Kalibr has both, but each with the force at another place.
  EXPECT_EQ(count("imu.gyro.g_sensitivity"),
            !GetParam().g_sensitivity || format == "kalibr");
  EXPECT_EQ(count("imu.accel.position"), format != "kalibr");
  rig.factory.imu.accel_position.setZero();
  EXPECT_EQ(count("imu.gyro.g_sensitivity"), !GetParam().g_sensitivity);
}

TEST(ExportKalibr, PositionsOfAxesReadBackAndAreSaidToBeInexact) {
  RandomValues random(21);
  Rig rig = RandomRig(kExpressible[0], &random);
  rig.factory.imu.accel_position = random.Vector(9, 0.01);
  const auto files = ExportRig("kalibr", rig, rig.factory, kOptions);
  ASSERT_TRUE(files.ok()) << files.status();
  EXPECT_THAT(Names(files->losses), Contains("imu.accel.position"));
  EXPECT_THAT(LoaderFaults("kalibr", files->files), IsEmpty());
  const auto again = ImportRig("kalibr", files->files, kOptions);
  ASSERT_TRUE(again.ok()) << again.status();
  ASSERT_TRUE(SameShape(again->rig.factory, rig.factory));
  EXPECT_LT(BoxMinus(again->rig.factory, rig.factory)
                .head(kMaxImuTangentSize)
                .cwiseAbs()
                .maxCoeff(),
            1e-9);
  // The same of all axes is exact.
  rig.factory.imu.gyro_g_sensitivity.resize(0);
  rig.factory.imu.accel_position = random.Vector(3, 0.05);
  const auto one = ExportRig("kalibr", rig, rig.factory, kOptions);
  ASSERT_TRUE(one.ok()) << one.status();
  ExpectSamePredictions(
      rig.factory, ReadAsTool("kalibr", one->files, kRate_hz), &random);
}

// Both IMUs measure the same body, with the distance between them.
TEST(ExportKalibr, ASecondImuHasAFileOfItsOwn) {
  RandomValues random(22);
  for (int trial = 0; trial < 20; ++trial) {
    Rig rig = RandomRig(kExpressible[0], &random);
    rig.factory.imu1 = random.ThetaOfTwoImus().imu1;
    rig.factory.imu1->accel_position.resize(0);
    rig.factory.imu1->time_offset_s = random.Uniform(-0.01, 0.01);
    rig.imu1_noise = {2e-4, 3e-3, 4e-6, 5e-5};
    const auto files = ExportRig("kalibr", rig, rig.factory, kOptions);
    ASSERT_TRUE(files.ok()) << files.status();
    EXPECT_THAT(LoaderFaults("kalibr", files->files), IsEmpty());
    ASSERT_EQ(files->files.size(), 3u);
    EXPECT_EQ(files->files[2].name, "imu1.yaml");
    EXPECT_THAT(Names(files->losses), Contains("imu1.T_i_b"));
    EXPECT_THAT(Names(files->losses), Not(Contains("imu1")));
    const Tool tool = ReadAsTool("kalibr", files->files, kRate_hz);
    ExpectSamePredictions(rig.factory, tool, &random);
    ExpectSameSecondImu(rig.factory, tool, &random);

    const auto again = ImportRig("kalibr", files->files, kOptions);
    ASSERT_TRUE(again.ok()) << again.status();
    EXPECT_EQ(Names(again->losses), std::vector<std::string>{"imu1.T_i_b"});
    ASSERT_TRUE(SameShape(again->rig.factory, rig.factory));
    const Eigen::VectorXd difference =
        BoxMinus(again->rig.factory, rig.factory);
    ExpectSameNoise(again->rig.imu1_noise, rig.imu1_noise);
    int fov = 0;  // whose w is written as its magnitude
    for (const CameraCalibration& camera : rig.factory.cameras) {
      fov += camera.model == Model::kFov ? 1 : 0;
    }
    EXPECT_LE((difference.array().abs() > 1e-9).count(), fov);
  }
}

TEST_P(Export, NothingIsLostOfANominalDevice) {
  RandomValues random(10);
  Rig rig;
  rig.factory.cameras = {random.Camera(Model::kEquidistant)};
  rig.factory.cameras[0].f = {400, 400};  // no ray is beyond 90 degrees
  Place(GetParam(), &rig);
  const auto files = ExportRig(GetParam().format, rig, rig.factory, kOptions);
  ASSERT_TRUE(files.ok()) << files.status();
  for (const Loss& loss : files->losses) {
    EXPECT_FALSE(loss.changes_prediction) << loss.name;
  }
}

TEST_P(Export, AModelWithoutWordsIsRefused) {
  RandomValues random(11);
  Rig rig;
  rig.factory.cameras = {random.Camera(Model::kFov)};
  const auto files = ExportRig(GetParam().format, rig, rig.factory, kOptions);
  const std::vector<Model>& models = GetParam().models;
  const bool has =
      std::find(models.begin(), models.end(), Model::kFov) != models.end();
  EXPECT_EQ(files.ok(), has);
  if (has) return;
  EXPECT_EQ(files.status().code(), absl::StatusCode::kFailedPrecondition);
  const std::string message(files.status().message());
  EXPECT_THAT(message, HasSubstr("cam0 has the distortion model fov, but"));
  EXPECT_THAT(message, HasSubstr(GetParam().format));
  EXPECT_THAT(message, HasSubstr("; kalibr and maplab have it"));
}

// Coefficients that are zero are none: a camera is written as the model that
// its own one extends.
TEST_P(Export, AModelWithZeroCoefficientsIsTheSmallerOne) {
  RandomValues random(18);
  for (const Model model : {kRadialTangential5, kRadialTangential8}) {
    Rig rig;
    CameraCalibration camera = random.Camera(Model::kRadialTangential);
    const DistortionVector four = camera.distortion;
    camera.model = model;
    camera.distortion = DistortionVector::Zero(DistortionSize(model));
    camera.distortion.head<4>() = four;
    rig.factory.cameras = {camera};
    Place(GetParam(), &rig);
    const auto files = ExportRig(GetParam().format, rig, rig.factory, kOptions);
    ASSERT_TRUE(files.ok()) << files.status();
    EXPECT_THAT(LoaderFaults(GetParam().format, files->files), IsEmpty());
    const Tool tool = ReadAsTool(GetParam().format, files->files, kRate_hz);
    ExpectSamePredictions(rig.factory, tool, &random);
    const auto again = ImportRig(GetParam().format, files->files, kOptions);
    ASSERT_TRUE(again.ok()) << again.status();
    EXPECT_EQ(again->rig.factory.cameras[0].model, Model::kRadialTangential);
    // Any of them that is not zero makes it the larger one, or an error.
    rig.factory.cameras[0].distortion[4] = 1e-3;
    const auto larger =
        ExportRig(GetParam().format, rig, rig.factory, kOptions);
    const std::vector<Model>& models = GetParam().models;
    const bool has =
        std::find(models.begin(), models.end(), kRadialTangential5) !=
        models.end();
    ASSERT_EQ(larger.ok(), has) << larger.status();
    if (!has) continue;
    const auto read = ImportRig(GetParam().format, larger->files, kOptions);
    ASSERT_TRUE(read.ok()) << read.status();
    EXPECT_EQ(read->rig.factory.cameras[0].model, kRadialTangential5);
  }
}

// All but Basalt. At 60 px the circle of all rays ends within the image.
TEST_P(Export, RaysBeyond90DegreesAreSaidToBeLostWhereTheToolHasNone) {
  RandomValues random(19);
  const std::string format = GetParam().format;
  Rig rig;
  rig.factory.cameras = {random.Camera(Model::kEquidistant)};
  CameraCalibration& camera = rig.factory.cameras[0];
  camera.distortion.setZero();
  for (const double f_px : {400.0, 200.0, 60.0}) {
    camera.f = {f_px, f_px};
    const auto files = ExportRig(format, rig, rig.factory, kOptions);
    ASSERT_TRUE(files.ok()) << files.status();
    const auto names = Names(files->losses);
    EXPECT_EQ(std::count(names.begin(), names.end(), "cam0.distortion"),
              format != "basalt" && f_px < 400)
        << f_px;
  }
}

// OpenCV and YAML 1.1 tell an integer from a number, and want an exponent to
// follow a decimal point.
TEST_P(Export, NumbersReadAsNumbersEverywhere) {
  RandomValues random(12);
  Rig rig;
  rig.factory.cameras = {random.Camera(Model::kEquidistant)};
  rig.factory.cameras[0].f = {300, 1e-7};
  const auto files = ExportRig(GetParam().format, rig, rig.factory, kOptions);
  ASSERT_TRUE(files.ok()) << files.status();
  const std::regex bare("[ \\[-][0-9]+e[-+]");
  for (const TextFile& file : files->files) {
    if (GetParam().format == std::string("basalt")) continue;  // JSON
    EXPECT_FALSE(std::regex_search(file.text, bare)) << file.text;
    EXPECT_THAT(file.text.substr(0, 300), Not(HasSubstr("300,")));
  }
}

INSTANTIATE_TEST_SUITE_P(Formats,
                         Export,
                         testing::ValuesIn(kExpressible),
                         [](const auto& info) {
                           return std::string(info.param.format);
                         });

TEST(Formats, BasaltsOdometryIsNotSaidToApplyATimeOffset) {
  RandomValues random(17);
  Rig rig;
  rig.factory.cameras = {random.Camera(Model::kEquidistant)};
  const auto without = ExportRig("basalt", rig, rig.factory, kOptions);
  ASSERT_TRUE(without.ok()) << without.status();
  EXPECT_THAT(Names(without->losses), Not(Contains("cam_time_offset_ns")));
  rig.factory.cameras[0].time_offset_s = -0.004;
  const auto files = ExportRig("basalt", rig, rig.factory, kOptions);
  ASSERT_TRUE(files.ok()) << files.status();
  EXPECT_EQ(files->losses[0].name, "cam_time_offset_ns");
  EXPECT_THAT(files->losses[0].text, HasSubstr("add -0.004 s"));
}

// The comparison with the table of a loader sees what it must.
TEST(LoaderTables, FindWhatIsMissingOfAnotherTypeOrUnknown) {
  RandomValues random(16);
  Rig rig;
  rig.factory.cameras = {random.Camera(Model::kEquidistant)};
  const auto files = ExportRig("kalibr", rig, rig.factory, kOptions);
  ASSERT_TRUE(files.ok()) << files.status();
  for (const auto& [from, to, fault] :
       std::initializer_list<std::array<std::string, 3>>{
           {"update_rate: 250.0", "", "update_rate is missing"},
           {"update_rate: 250.0", "update_rate: -1.0", "update_rate does not"},
           {"rostopic: /imu0", "rostopic: 0", "rostopic does not"},
           {"rostopic: /imu0", "rostopics: /imu0", "rostopics is not in the"},
           {"model: scale", "imu1: {}\nmodel: scale", "imu1 is not in the"},
           {"[640, 480]", "[640.0, 480]", "resolution does not"},
           {"timeshift_cam_imu: 0.0", "timeshift_cam_imu: 0", "timeshift"},
           {"cam0:", "camera:", "camera is counted as a camera"}}) {
    std::vector<TextFile> changed = files->files;
    for (TextFile& file : changed) {
      const std::size_t at = file.text.find(from);
      if (at != std::string::npos) file.text.replace(at, from.size(), to);
    }
    EXPECT_THAT(LoaderFaults("kalibr", changed), Contains(HasSubstr(fault)));
  }
}

struct Refused {
  const char* format;
  void (*change)(Rig* rig);
  const char* message;
};

// Values at which the loader of a tool stops.
TEST(Formats, AValueThatTheToolRefusesIsNotWritten) {
  for (const Refused& refused : std::initializer_list<Refused>{
           {"kalibr",
            [](Rig* rig) { rig->factory.cameras[1].c.x() = -1; },
            "cam1 has a principal point at -1"},
           {"kalibr",
            [](Rig* rig) {
              rig->factory.cameras[1].model = kUnified;
              rig->factory.cameras[1].distortion =
                  (Eigen::VectorXd(5) << -0.1, 0, 0, 0, 0).finished();
            },
            "cam1 has xi = -0.1"},
           {"kalibr",
            [](Rig* rig) {
              rig->factory.cameras[1].model = kDoubleSphere;
              rig->factory.cameras[1].distortion = Eigen::Vector2d(-0.1, -0.2);
            },
            "cam1 has alpha = -0.2"},
           {"maplab",
            [](Rig* rig) {
              rig->factory.cameras[1].model = kUnified;
              rig->factory.cameras[1].distortion =
                  (Eigen::VectorXd(5) << -0.1, 0, 0, 0, 0).finished();
            },
            "cam1 has xi = -0.1"},
           {"maplab",
            [](Rig* rig) { rig->factory.cameras[1].c.y() = 0; },
            "cam1 has a principal point at"},
           {"maplab",
            [](Rig* rig) { rig->factory.cameras[0].distortion[0] = 0.3; },
            "cam0 has w = 0.3"},
           {"maplab",
            [](Rig* rig) { rig->gravity_mps2 = 1.62; },
            "gravity of 1.62 m/s^2"}}) {
    RandomValues random(14);
    Rig rig;
    rig.factory.cameras = {random.Camera(Model::kFov),
                           random.Camera(Model::kEquidistant)};
    rig.factory.cameras[0].distortion[0] = 0.9;
    ASSERT_TRUE(ExportRig(refused.format, rig, rig.factory, kOptions).ok());
    refused.change(&rig);
    const auto files = ExportRig(refused.format, rig, rig.factory, kOptions);
    EXPECT_EQ(files.status().code(), absl::StatusCode::kFailedPrecondition);
    EXPECT_THAT(std::string(files.status().message()),
                HasSubstr(refused.message));
  }
}

TEST(Formats, KalibrIsNotSaidToReadTheMatricesOfAnImu) {
  RandomValues random(15);
  Rig rig;
  rig.factory.cameras = {random.Camera(Model::kEquidistant)};
  const auto nominal = ExportRig("kalibr", rig, rig.factory, kOptions);
  ASSERT_TRUE(nominal.ok()) << nominal.status();
  EXPECT_THAT(Names(nominal->losses), Not(Contains("imu_matrices")));
  rig.factory.imu.s_g.x() = 1.01;
  const auto files = ExportRig("kalibr", rig, rig.factory, kOptions);
  ASSERT_TRUE(files.ok()) << files.status();
  EXPECT_THAT(Names(files->losses), Contains("imu_matrices"));
}

TEST(Formats, AllAreTested) {
  std::vector<std::string> tested;
  for (const Expressible& one : kExpressible) tested.emplace_back(one.format);
  std::vector<std::string> all;
  for (const FormatInfo& info : Formats()) all.push_back(info.name);
  EXPECT_EQ(tested, all);
}

TEST(Formats, AnUnknownOneIsNamedWithThoseThatAre) {
  const auto rig = ImportRig("okvis", {}, {});
  EXPECT_EQ(rig.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(rig.status().message()),
              HasSubstr("one of kalibr, openvins, orb_slam3"));
  EXPECT_FALSE(ExportRig("kalibr", Rig(), Calibration(), {}).ok());
}

}  // namespace
}  // namespace selfcal::client
