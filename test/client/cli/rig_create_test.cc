// selfcal rig create: priors, and some of the cameras of a file.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "client/cli/camera_choice.h"
#include "client/formats/format.h"
#include "core/model/imu_presets.h"
#include "test/client/cli/commands_fixture.h"

namespace selfcal::client {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

class RigCreate : public Commands {
 protected:
  // The files of kalibr for a rig with so many cameras, as arguments.
  std::vector<std::string> FromKalibr(int cameras,
                                      bool second_imu = false) const {
    Rig rig = ARig("device");
    if (second_imu) {
      rig.factory.imu1.emplace().p_JI.x() = 0.05;
      rig.imu1_noise = rig.imu_noise;
    }
    CameraCalibration camera = rig.factory.cameras[0];
    camera.model = DistortionModel::kEquidistant;
    camera.distortion = Eigen::Vector4d(0.1, 0.01, 0.001, 0.0001);
    rig.factory.cameras.clear();
    for (int i = 0; i < cameras; ++i) {
      camera.f = {255.0 + i, 256.0 + i};
      camera.p_CI.x() = 0.1 * i;
      rig.factory.cameras.push_back(camera);
    }
    const auto exported = ExportRig("kalibr", rig, rig.factory, {});
    EXPECT_TRUE(exported.ok()) << exported.status();
    std::vector<std::string> arguments = {
        "rig", "create", "--id", "device", "--from", "kalibr"};
    for (const TextFile& file : exported->files) {
      arguments.push_back(temp_folder_.File(file.name));
      WriteBytes(arguments.back(), file.text);
    }
    return arguments;
  }
  static std::vector<std::string> With(std::vector<std::string> arguments,
                                       const std::vector<std::string>& more) {
    arguments.insert(arguments.end(), more.begin(), more.end());
    return arguments;
  }
};

TEST_F(RigCreate, TakesPriorsFromTheCommandLine) {
  const Outcome outcome = Selfcal(With(FromKalibr(1),
                                       {"--imu",
                                        "consumer",
                                        "--prior-sigma",
                                        "cam0.focal.x=2.5",
                                        "--prior-sigma",
                                        "imu.gyro.scale=0.03"}));
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const auto& sigmas = daemon_.rigs.back().prior_sigmas();
  ASSERT_GT(sigmas.size(), 2);
  EXPECT_EQ(sigmas[sigmas.size() - 2].pattern(), "cam0.focal.x");
  EXPECT_EQ(sigmas[sigmas.size() - 2].value(), 2.5);
  EXPECT_EQ(sigmas[sigmas.size() - 1].pattern(), "imu.gyro.scale.*");
  EXPECT_EQ(sigmas[sigmas.size() - 1].value(), 0.03);
}

TEST_F(RigCreate, RefusesPriorsOfComponentsThatAreNotThere) {
  const Outcome outcome =
      Selfcal(With(FromKalibr(1), {"--prior-sigma", "cam0.fcal.x=2"}));
  EXPECT_EQ(outcome.code, 2);
  EXPECT_THAT(outcome.err,
              AllOf(HasSubstr("--prior-sigma: the rig has no component"),
                    HasSubstr("did you mean 'cam0.focal.x'?"),
                    HasSubstr("imu.gyro.scale, ")));
  EXPECT_THAT(
      Selfcal(With(FromKalibr(1), {"--prior-sigma", "cam0.focal.x"})).err,
      HasSubstr("'cam0.focal.x' is not of the form COMPONENT=NUMBER"));
  EXPECT_TRUE(daemon_.rigs.empty());
}

TEST_F(RigCreate, APresetSetsNoiseFullScaleAndTolerances) {
  ASSERT_EQ(Selfcal(With(FromKalibr(1), {"--imu-preset", "BMI088"})).code, 0);
  const v1::Rig& rig = daemon_.rigs.back();
  const ImuPreset& preset = *FindImuPreset("bmi088");
  EXPECT_EQ(rig.imu_noise().gyro_noise_density(),
            preset.noise.gyro_noise_density);
  EXPECT_EQ(rig.imu_noise().accel_noise_density(),
            preset.noise.accel_noise_density);
  EXPECT_EQ(rig.imu_noise().gyro_bias_random_walk(),
            preset.noise.gyro_bias_random_walk);
  EXPECT_EQ(rig.imu_noise().accel_bias_random_walk(),
            preset.noise.accel_bias_random_walk);
  EXPECT_EQ(rig.imu().gyro_max(), preset.full_scale.gyro_radps);
  EXPECT_EQ(rig.imu().accel_max(), preset.full_scale.accel_mps2);
  ASSERT_GT(rig.prior_sigmas_size(), 0);
  EXPECT_EQ(rig.prior_sigmas(0).pattern(), "imu.gyro.scale.*");
  EXPECT_EQ(rig.prior_sigmas(0).value(), 0.02);
}

TEST_F(RigCreate, APresetOfTheSecondImuIsItsOwn) {
  const std::string none =
      Selfcal(With(FromKalibr(1), {"--imu1-preset", "bmi088"})).err;
  EXPECT_THAT(none, HasSubstr("--imu1-preset: the rig has no second IMU"));
  EXPECT_TRUE(daemon_.rigs.empty());
  const Outcome created =
      Selfcal(With(FromKalibr(1, true), {"--imu1-preset", "bmi088"}));
  ASSERT_EQ(created.code, 0) << created.err;
  const v1::Rig& rig = daemon_.rigs.back();
  const ImuPreset& preset = *FindImuPreset("bmi088");
  EXPECT_EQ(rig.imu1_noise().gyro_noise_density(),
            preset.noise.gyro_noise_density);
  EXPECT_NE(rig.imu_noise().gyro_noise_density(),
            preset.noise.gyro_noise_density);
  EXPECT_EQ(rig.imu1().accel_max(), preset.full_scale.accel_mps2);
  ASSERT_GT(rig.prior_sigmas_size(), 0);
  EXPECT_EQ(rig.prior_sigmas(0).pattern(), "imu1.gyro.scale.*");
  EXPECT_THAT(
      Selfcal(With(FromKalibr(1, true), {"--imu1-preset", "bmi08"})).err,
      HasSubstr("--imu1-preset: 'bmi08' must be one of"));
}

TEST_F(RigCreate, OtherOptionsTakePrecedenceOverAPreset) {
  ASSERT_EQ(Selfcal(With(FromKalibr(1),
                         {"--imu-preset",
                          "bmi088",
                          "--gyro-noise",
                          "3e-4",
                          "--accel-bias-walk",
                          "1e-3",
                          "--accel-max",
                          "58",
                          "--imu",
                          "factory-calibrated"}))
                .code,
            0);
  const v1::Rig& rig = daemon_.rigs.back();
  const ImuPreset& preset = *FindImuPreset("bmi088");
  EXPECT_EQ(rig.imu_noise().gyro_noise_density(), 3e-4);
  EXPECT_EQ(rig.imu_noise().accel_noise_density(),
            preset.noise.accel_noise_density);
  EXPECT_EQ(rig.imu_noise().accel_bias_random_walk(), 1e-3);
  EXPECT_EQ(rig.imu().accel_max(), 58);
  EXPECT_EQ(rig.imu().gyro_max(), preset.full_scale.gyro_radps);
  EXPECT_EQ(rig.prior_sigmas(0).value(), 0.003);
}

TEST_F(RigCreate, NamesThePresetsThatThereAre) {
  const Outcome outcome =
      Selfcal(With(FromKalibr(1), {"--imu-preset", "bmi08"}));
  EXPECT_EQ(outcome.code, 2);
  EXPECT_THAT(outcome.err,
              AllOf(HasSubstr("--imu-preset: 'bmi08' must be one of adis16448"),
                    HasSubstr("did you mean 'bmi088'?")));
  EXPECT_TRUE(daemon_.rigs.empty());
}

// 0.02 m/s^2 at 400 Hz is a density of 0.001 m/s^2/sqrt(Hz).
TEST_F(RigCreate, TakesTheNoiseOfReadingsAtTheirRate) {
  const Outcome outcome = Selfcal(With(FromKalibr(1),
                                       {"--accel-noise-rms",
                                        "0.02",
                                        "--gyro-noise-rms",
                                        "0.004",
                                        "--imu-rate",
                                        "400"}));
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const v1::ImuNoise& noise = daemon_.rigs.back().imu_noise();
  EXPECT_DOUBLE_EQ(noise.accel_noise_density(), 0.001);
  EXPECT_DOUBLE_EQ(noise.gyro_noise_density(), 0.0002);
  EXPECT_THAT(Selfcal(With(FromKalibr(1), {"--gyro-noise-rms", "0.01"})).err,
              HasSubstr("--imu-rate"));
  EXPECT_THAT(Selfcal(With(FromKalibr(1),
                           {"--gyro-noise-rms",
                            "0.01",
                            "--gyro-noise",
                            "1e-4",
                            "--imu-rate",
                            "400"}))
                  .err,
              HasSubstr("--gyro-noise"));
  EXPECT_EQ(daemon_.rigs.size(), 1u);
}

TEST_F(RigCreate, ListsThePresetsWithoutADaemon) {
  const Outcome list = client::Selfcal({"rig", "presets"});
  EXPECT_EQ(list.code, 0) << list.err;
  EXPECT_THAT(
      list.out,
      HasSubstr("mpu9250\t10\t300\t1996\t16\tconsumer\tInvenSense MPU-9250"));
  const Outcome one = client::Selfcal({"rig", "presets", "MPU-9250"});
  EXPECT_THAT(one.out, HasSubstr("PS-MPU-9250A-01"));
  EXPECT_THAT(client::Selfcal({"rig", "presets", "--json"}).out,
              HasSubstr("\"gyro_noise_density\": 0.00017"));
  const Outcome unknown = client::Selfcal({"rig", "presets", "mpu"});
  EXPECT_EQ(unknown.code, 2);
  EXPECT_THAT(unknown.err, HasSubstr("did you mean 'mpu9250'?"));
}

// camera_info of ROS has neither poses nor an IMU.
TEST_F(RigCreate, TakesPosesThatAFileDoesNotHaveFromTheCommandLine) {
  const std::vector<std::string> line = {
      "rig",
      "create",
      "--id",
      "device",
      "--strict",
      "--imu-preset",
      "bmi055",
      "--from",
      "camera_info",
      WriteFile("image_width: 640\nimage_height: 480\n"
                "camera_matrix:\n"
                "  data: [400, 0, 320, 0, 401, 240, 0, 0, 1]\n"
                "distortion_model: plumb_bob\n"
                "distortion_coefficients:\n  data: [0.1, 0, 0, 0, 0]\n")};
  const Outcome without = Selfcal(line);
  EXPECT_EQ(without.code, 2);
  EXPECT_THAT(
      without.err,
      AllOf(HasSubstr("lost: cam0.extrinsics: camera_info has no poses"),
            HasSubstr("note: imu_noise")));
  const Outcome with = Selfcal(
      With(line, {"--extrinsics", "cam0=0.1,-0.2,0.03,0.5,-0.5,0.5,0.5"}));
  ASSERT_EQ(with.code, 0) << with.err;
  const auto& camera = daemon_.rigs.back().factory().cameras(0);
  EXPECT_EQ(camera.p_ci().y(), -0.2);
  EXPECT_EQ(camera.q_ci().x(), 0.5);
  EXPECT_EQ(camera.q_ci().y(), -0.5);
  EXPECT_EQ(camera.q_ci().w(), 0.5);
  for (const auto& [pose, message] :
       std::vector<std::pair<std::string, std::string>>{
           {"cam1=0,0,0,0,0,0,1", "there is no camera 'cam1'"},
           {"cam0=0,0,0,0,0,1", "is not of the form"},
           {"cam0=0,0,0,0,0,0,1,2", "is not of the form"},
           {"cam0=0,0,0,1,0,0,1", "a quaternion of length 1"},
           {"cam0=0,0,nan,0,0,0,1", "is not of the form"}}) {
    const Outcome wrong = Selfcal(With(line, {"--extrinsics", pose}));
    EXPECT_EQ(wrong.code, 2);
    EXPECT_THAT(wrong.err, HasSubstr(message));
  }
}

TEST_F(RigCreate, UsesSomeOfTheCameras) {
  const Outcome outcome =
      Selfcal(With(FromKalibr(3), {"--cameras", "cam0,cam2"}));
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const auto& cameras = daemon_.rigs.back().factory().cameras();
  ASSERT_EQ(cameras.size(), 2);
  EXPECT_NEAR(cameras[0].f().x(), 255, 1e-9);
  EXPECT_NEAR(cameras[1].f().x(), 257, 1e-9);
  EXPECT_THAT(outcome.err, HasSubstr("note: cam2: is cam1 of the rig\n"));
}

TEST_F(RigCreate, NamesTheCamerasThatThereAre) {
  const Outcome unknown = Selfcal(With(FromKalibr(2), {"--cameras", "cam7"}));
  EXPECT_EQ(unknown.code, 2);
  EXPECT_THAT(unknown.err,
              AllOf(HasSubstr("--cameras: there is no camera 'cam7'"),
                    HasSubstr("Known: cam0, cam1")));
  EXPECT_THAT(Selfcal(With(FromKalibr(2), {"--cameras", "cam1,cam1"})).err,
              HasSubstr("cam1 is given twice"));
  EXPECT_THAT(
      Selfcal({"rig", "create", WriteFile("{}"), "--cameras", "cam0"}).err,
      HasSubstr("--from and --vi-map"));
  EXPECT_TRUE(daemon_.rigs.empty());
}

TEST_F(RigCreate, SaysThatAFolderIsNoFile) {
  const std::string folder = temp_folder_.File("");
  const std::string text =
      "cannot read " + folder + ": it is a folder; name a file";
  const Outcome own = Selfcal({"rig", "create", folder});
  EXPECT_EQ(own.code, 2);
  EXPECT_THAT(own.err, HasSubstr(text));
  const Outcome foreign =
      Selfcal({"rig", "create", "--from", "kalibr", folder, "--id", "a"});
  EXPECT_EQ(foreign.code, 2);
  EXPECT_THAT(foreign.err, HasSubstr(text));
}

TEST_F(RigCreate, NeedsAnIdForWhatNamesNoRig) {
  for (const std::vector<std::string>& line :
       std::vector<std::vector<std::string>>{
           {"rig", "create", "--from", "kalibr", WriteFile("")},
           {"rig", "create", "--vi-map", temp_folder_.File("")}}) {
    const Outcome outcome = Selfcal(line);
    EXPECT_EQ(outcome.code, 2);
    EXPECT_THAT(outcome.err, HasSubstr("--id: is required with " + line[2]));
    EXPECT_THAT(outcome.err, Not(HasSubstr("rig.name")));
  }
  EXPECT_TRUE(daemon_.rigs.empty());
}

TEST(KeepCameras, DropsTheLossesOfOthers) {
  Rig rig = ARig("device");
  rig.factory.cameras.push_back(rig.factory.cameras[0]);
  std::vector<Loss> losses = {{"cam0.time_offset", "lost", true},
                              {"cam1", "lost", true},
                              {"imu", "lost", true}};
  ASSERT_TRUE(KeepCameras({"cam1"}, &rig, &losses).ok());
  ASSERT_EQ(losses.size(), 3u);
  EXPECT_EQ(losses[0].name, "cam1");
  EXPECT_EQ(losses[1].name, "imu");
  EXPECT_EQ(losses[2].text, "is cam0 of the rig");
}

}  // namespace
}  // namespace selfcal::client
