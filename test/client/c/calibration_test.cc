// Calibrations of the C interface, and how they come.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <cstring>
#include <string>
#include <utility>
#include <vector>

#include "client/c/selfcal.h"
#include "core/model/camera.h"
#include "core/model/imu.h"
#include "proto/convert.h"
#include "test/client/c/cxx11_session.h"
#include "test/client/selfcal/fake_daemon.h"
#include "test/support/eventually.h"

namespace selfcal::testing_c {
namespace {

// Two cameras, with numbers that differ everywhere.
Calibration Theta() {
  Calibration theta;
  theta.imu.s_g = {1.01, 1.02, 1.03};
  theta.imu.m_g = {0.01, 0.02, 0.03};
  theta.imu.s_a = {0.99, 0.98, 0.97};
  theta.imu.m_a = {-0.01, -0.02, -0.03};
  theta.imu.q_AI = Eigen::Quaterniond(0.9, 0.1, -0.3, 0.3).normalized();
  theta.cameras.resize(2);
  for (CameraCalibration& camera : theta.cameras) {
    camera.q_CI = Eigen::Quaterniond(0.5, -0.5, 0.5, -0.5);
    camera.p_CI = {0.1, -0.2, 0.3};
    camera.f = {400, 410};
    camera.c = {320, 240};
    camera.distortion << 0.9;
    camera.time_offset_s = 0.004;
    camera.width_px = 640;
    camera.height_px = 480;
  }
  CameraCalibration& second = theta.cameras[1];
  second.model = DistortionModel::kRadialTangential;
  second.distortion = Eigen::Vector4d(0.1, -0.05, 0.001, 0.002);
  second.f = {500, 510};
  second.line_delay_s = 3e-5;
  second.time_drift = 2e-5;
  return theta;
}

v1::Calibration Message(std::int64_t version,
                        bool with_covariance,
                        const Calibration& theta = Theta()) {
  v1::Calibration message;
  message.set_version(version);
  *message.mutable_parameters() = ToProto(theta);
  const int size = TangentSize(theta);
  for (int i = 0; with_covariance && i < size * (size + 1) / 2; ++i) {
    message.add_covariance(1 + i);
  }
  return message;
}

void Count(const selfcal_calibration* calibration, void* user) {
  EXPECT_GT(selfcal_calibration_version(calibration), 0);
  ++*static_cast<std::atomic<int>*>(user);
}

class CalibrationTest : public ::testing::Test {
 protected:
  CalibrationTest() { daemon_.Start(); }
  ~CalibrationTest() override {
    selfcal_watch_destroy(watch_);
    selfcal_calibration_destroy(calibration_);
  }

  void Receive(const v1::Calibration& message) {
    daemon_.Publish(message);
    const std::string target = daemon_.target();
    selfcal_client_options options = {};
    options.struct_size = sizeof(options);
    options.target = target.c_str();
    options.rig = "device";
    options.min_backoff_ms = 1;
    ASSERT_EQ(selfcal_watch_create(&options, &Count, &count_, &watch_, nullptr),
              SELFCAL_OK);
    ASSERT_TRUE(Eventually([&] { return count_ > 0; }));
    calibration_ = selfcal_watch_newest(watch_);
    ASSERT_NE(calibration_, nullptr);
  }

  client::FakeDaemon daemon_;
  std::atomic<int> count_ = 0;
  selfcal_watch* watch_ = nullptr;
  selfcal_calibration* calibration_ = nullptr;
  selfcal_error error_ = {};
};

TEST_F(CalibrationTest, HasTheValuesThatWerePublished) {
  const Calibration theta = Theta();
  Receive(Message(7, true));
  EXPECT_EQ(selfcal_calibration_version(calibration_), 7);
  EXPECT_EQ(selfcal_calibration_camera_count(calibration_), 2);

  selfcal_imu imu = {};
  imu.struct_size = sizeof(imu);
  ASSERT_EQ(selfcal_calibration_get_imu(calibration_, &imu, nullptr), 0);
  EXPECT_EQ(Eigen::Vector3d(imu.gyro_scale), theta.imu.s_g);
  EXPECT_EQ(Eigen::Vector3d(imu.gyro_misalignment), theta.imu.m_g);
  EXPECT_EQ(Eigen::Vector3d(imu.accel_scale), theta.imu.s_a);
  EXPECT_EQ(Eigen::Vector3d(imu.accel_misalignment), theta.imu.m_a);
  EXPECT_EQ(imu.q_AI.w, theta.imu.q_AI.w());
  EXPECT_EQ(imu.q_AI.x, theta.imu.q_AI.x());
  EXPECT_EQ(imu.q_AI.y, theta.imu.q_AI.y());
  EXPECT_EQ(imu.q_AI.z, theta.imu.q_AI.z());

  for (std::int32_t j = 0; j < 2; ++j) {
    const CameraCalibration& expected =
        theta.cameras[static_cast<std::size_t>(j)];
    selfcal_camera camera = {};
    camera.struct_size = sizeof(camera);
    ASSERT_EQ(selfcal_calibration_get_camera(calibration_, j, &camera, nullptr),
              0);
    EXPECT_EQ(camera.width_px, 640);
    EXPECT_EQ(camera.height_px, 480);
    EXPECT_EQ(std::string(camera.model), DistortionName(expected.model));
    ASSERT_EQ(camera.distortion_size, expected.distortion.size());
    for (int i = 0; i < SELFCAL_MAX_DISTORTION; ++i) {
      EXPECT_EQ(camera.distortion[i],
                i < expected.distortion.size() ? expected.distortion[i] : 0);
    }
    EXPECT_EQ(Eigen::Vector2d(camera.f), expected.f);
    EXPECT_EQ(Eigen::Vector2d(camera.c), expected.c);
    EXPECT_EQ(camera.q_CI.w, 0.5);
    EXPECT_EQ(camera.q_CI.x, -0.5);
    EXPECT_EQ(camera.q_CI.y, 0.5);
    EXPECT_EQ(camera.q_CI.z, -0.5);
    EXPECT_EQ(Eigen::Vector3d(camera.p_CI), expected.p_CI);
    EXPECT_EQ(camera.time_offset_s, 0.004);
    EXPECT_EQ(camera.rolling_shutter, j == 1 ? 1 : 0);
    EXPECT_EQ(camera.line_delay_s, j == 1 ? 3e-5 : 0);
    EXPECT_EQ(camera.clock_drifts, j == 1 ? 1 : 0);
    EXPECT_EQ(camera.time_drift, j == 1 ? 2e-5 : 0);
  }
}

TEST_F(CalibrationTest, WithSlopesIsReadAtATemperature) {
  Calibration theta = Theta();
  theta.imu.s_g_slope = Eigen::Vector3d(1e-3, 2e-3, -0.03);
  theta.cameras[1].f_slope = Eigen::Vector2d(0.1, 0.2);
  Receive(Message(7, true, theta));
  selfcal_calibration* at = nullptr;
  ASSERT_EQ(selfcal_calibration_at_temperature(calibration_, 35, &at, &error_),
            0)
      << error_.message;
  EXPECT_EQ(selfcal_calibration_version(at), 7);
  EXPECT_EQ(selfcal_calibration_component_count(at), TangentSize(Theta()));
  EXPECT_EQ(selfcal_calibration_component_count(calibration_),
            TangentSize(Theta()) + 5);
  selfcal_imu imu = {};
  imu.struct_size = sizeof(imu);
  ASSERT_EQ(selfcal_calibration_get_imu(at, &imu, nullptr), 0);
  EXPECT_NEAR(imu.gyro_scale[0], 1.01 + 10 * 1e-3, 1e-12);
  selfcal_camera camera = {};
  camera.struct_size = sizeof(camera);
  ASSERT_EQ(selfcal_calibration_get_camera(at, 1, &camera, nullptr), 0);
  EXPECT_NEAR(camera.f[1], 510 + 10 * 0.2, 1e-9);
  const auto size = static_cast<std::size_t>(TangentSize(Theta()));
  std::vector<double> covariance(size * size);
  ASSERT_EQ(selfcal_calibration_get_covariance(
                at, covariance.data(), covariance.size(), nullptr),
            0);
  EXPECT_GT(covariance[0], 1);  // that of the slope is in it
  selfcal_calibration_destroy(at);
  at = calibration_;
  EXPECT_EQ(selfcal_calibration_at_temperature(calibration_, 80, &at, &error_),
            SELFCAL_INVALID_ARGUMENT);
  EXPECT_EQ(at, nullptr);
  EXPECT_NE(std::string(error_.message).find("s_g must be positive"),
            std::string::npos)
      << error_.message;
}

TEST_F(CalibrationTest, NamesEachComponentWithItsSigma) {
  Receive(Message(1, true));
  const auto components = TangentComponents(Theta());
  const Eigen::VectorXd values = ReadableValues(Theta());
  const auto size = static_cast<std::int32_t>(components.size());
  ASSERT_EQ(selfcal_calibration_component_count(calibration_), size);
  std::vector<double> covariance(components.size() * components.size());
  ASSERT_EQ(selfcal_calibration_get_covariance(
                calibration_, covariance.data(), covariance.size(), nullptr),
            0);
  // Published as a lower triangle, row by row, from 1.
  EXPECT_EQ(covariance[0], 1);
  EXPECT_EQ(covariance[1], 2);
  EXPECT_EQ(covariance[components.size()], 2);
  EXPECT_EQ(covariance[components.size() + 1], 3);
  for (std::int32_t i = 0; i < size; ++i) {
    selfcal_component component = {};
    component.struct_size = sizeof(component);
    ASSERT_EQ(
        selfcal_calibration_get_component(calibration_, i, &component, nullptr),
        0);
    const auto at = static_cast<std::size_t>(i);
    EXPECT_EQ(component.name, components[at].name);
    EXPECT_EQ(component.unit, components[at].unit);
    EXPECT_EQ(component.value, values[i]);
    EXPECT_EQ(component.sigma,
              std::sqrt((i + 1.0) * (i + 2.0) / 2));  // of that triangle
  }
}

TEST_F(CalibrationTest, StatesThatThereIsNoCovariance) {
  Receive(Message(1, false));
  selfcal_component component = {};
  component.struct_size = sizeof(component);
  ASSERT_EQ(
      selfcal_calibration_get_component(calibration_, 0, &component, nullptr),
      0);
  EXPECT_TRUE(std::isnan(component.sigma));
  const auto size = static_cast<std::uint64_t>(
      selfcal_calibration_component_count(calibration_));
  std::vector<double> covariance(size * size, 5.0);
  EXPECT_EQ(selfcal_calibration_get_covariance(
                calibration_, covariance.data(), size * size, &error_),
            SELFCAL_FAILED_PRECONDITION);
  EXPECT_EQ(covariance[0], 5.0);
  EXPECT_EQ(selfcal_calibration_get_covariance(
                calibration_, covariance.data(), size, &error_),
            SELFCAL_INVALID_ARGUMENT);
}

TEST_F(CalibrationTest, AppliesItselfAsTheLibraryDoes) {
  const Calibration theta = Theta();
  Receive(Message(1, true));
  const double gyro[3] = {0.1, -0.2, 0.3};
  const double accel[3] = {1, 2, 9};
  const double b_g[3] = {0.01, 0.02, 0.03};
  const double b_a[3] = {0.1, 0.2, 0.3};
  double w_I[3];
  double f_I[3];
  ASSERT_EQ(selfcal_calibration_correct_imu(
                calibration_, gyro, accel, b_g, b_a, w_I, f_I, nullptr),
            0);
  const BodyRates rates = CorrectImu(theta.imu,
                                     Eigen::Vector3d(gyro),
                                     Eigen::Vector3d(accel),
                                     Eigen::Vector3d(b_g),
                                     Eigen::Vector3d(b_a));
  EXPECT_EQ(Eigen::Vector3d(w_I), rates.w_I);
  EXPECT_EQ(Eigen::Vector3d(f_I), rates.f_I);

  // From nothing wrong to the calibration.
  selfcal_imu ideal = {};
  ideal.struct_size = sizeof(ideal);
  std::fill_n(ideal.gyro_scale, 3, 1.0);
  std::fill_n(ideal.accel_scale, 3, 1.0);
  ideal.q_AI.w = 1;
  selfcal_camera camera = {};
  camera.struct_size = sizeof(camera);
  ASSERT_EQ(selfcal_calibration_get_camera(calibration_, 0, &camera, &error_),
            0);
  const selfcal_camera* const pointer = &camera;
  selfcal_calibration* from = nullptr;
  ASSERT_EQ(selfcal_calibration_create(&ideal, &pointer, 1, &from, &error_), 0)
      << error_.message;
  double carried_g[3] = {0.01, 0.02, 0.03};
  double carried_a[3] = {0.1, 0.2, 0.3};
  ASSERT_EQ(selfcal_calibration_carry_biases(
                from, calibration_, accel, carried_g, carried_a, nullptr),
            0);
  selfcal_calibration_destroy(from);
  const ImuBiases carried =
      CarryBiases(ImuCalibration(),
                  theta.imu,
                  Eigen::Vector3d(accel),
                  {Eigen::Vector3d(b_g), Eigen::Vector3d(b_a)});
  EXPECT_EQ(Eigen::Vector3d(carried_g), carried.b_g);
  EXPECT_EQ(Eigen::Vector3d(carried_a), carried.b_a);
  EXPECT_NE(carried.b_a, Eigen::Vector3d(b_a));

  const double p_C[3] = {0.1, 0.2, 1};
  double z_px[2];
  double bearing_C[3];
  ASSERT_EQ(selfcal_calibration_project(calibration_, 1, p_C, z_px, nullptr),
            0);
  Eigen::Vector2d expected;
  ASSERT_TRUE(
      Project(theta.cameras[1], Eigen::Vector3d(p_C), &expected, nullptr));
  EXPECT_EQ(Eigen::Vector2d(z_px), expected);
  ASSERT_EQ(
      selfcal_calibration_unproject(calibration_, 1, z_px, bearing_C, nullptr),
      0);
  EXPECT_LT(
      (Eigen::Vector3d(bearing_C) - Eigen::Vector3d(p_C).normalized()).norm(),
      1e-9);
  const double behind[3] = {0, 0, -1};
  EXPECT_EQ(selfcal_calibration_project(calibration_, 0, behind, z_px, nullptr),
            SELFCAL_OUT_OF_RANGE);
  EXPECT_EQ(selfcal_calibration_project(calibration_, 2, p_C, z_px, nullptr),
            SELFCAL_OUT_OF_RANGE);
}

// A block is set by its name, and used.
TEST_F(CalibrationTest, TakesAnyBlockByItsName) {
  Receive(Message(1, true));
  const double positions[3] = {0.03, -0.02, 0.01};
  selfcal_calibration* with = nullptr;
  ASSERT_EQ(
      selfcal_calibration_with_block(
          calibration_, "imu.accel.position", positions, 3, &with, &error_),
      0)
      << error_.message;
  EXPECT_EQ(selfcal_calibration_version(with), 0);
  EXPECT_EQ(selfcal_calibration_component_count(with),
            TangentSize(Theta()) + 3);
  Calibration theta = Theta();
  theta.imu.accel_position = Eigen::Vector3d(positions);
  const double gyro[3] = {1, -2, 3};
  const double accel[3] = {1, 2, 9};
  const double none[3] = {};
  const double dw_I[3] = {5, -6, 7};
  double w_I[3];
  double f_I[3];
  ASSERT_EQ(selfcal_calibration_correct_imu_dw(
                with, gyro, accel, none, none, dw_I, w_I, f_I, &error_),
            0);
  const BodyRates rates = CorrectImu(theta.imu,
                                     Eigen::Vector3d(gyro),
                                     Eigen::Vector3d(accel),
                                     Eigen::Vector3d::Zero(),
                                     Eigen::Vector3d::Zero(),
                                     Eigen::Vector3d(dw_I));
  EXPECT_EQ(Eigen::Vector3d(w_I), rates.w_I);
  EXPECT_EQ(Eigen::Vector3d(f_I), rates.f_I);

  selfcal_calibration* without = nullptr;
  ASSERT_EQ(selfcal_calibration_with_block(
                with, "imu.accel.position", nullptr, 0, &without, &error_),
            0);
  EXPECT_EQ(selfcal_calibration_component_count(without), TangentSize(Theta()));
  selfcal_calibration_destroy(without);
  selfcal_calibration_destroy(with);
}

TEST_F(CalibrationTest, TakesEachKindOfBlock) {
  Receive(Message(1, true));
  const auto read = [&](const char* name, std::vector<double> values) {
    selfcal_calibration* with = nullptr;
    selfcal_camera camera = {};
    camera.struct_size = sizeof(camera);
    EXPECT_EQ(
        selfcal_calibration_with_block(
            calibration_, name, values.data(), values.size(), &with, &error_),
        0)
        << error_.message;
    EXPECT_EQ(selfcal_calibration_get_camera(with, 1, &camera, &error_), 0);
    selfcal_calibration_destroy(with);
    return camera;
  };
  EXPECT_EQ(read("cam1.focal", {501, 502}).f[1], 502);
  EXPECT_EQ(read("cam1.q_CI", {0, 1, 0, 0}).q_CI.x, 1);
  EXPECT_EQ(read("cam1.distortion", {0.1, 0.2, 0, 0.01}).distortion[3], 0.01);
  EXPECT_EQ(read("cam1.time_offset", {0.01}).time_offset_s, 0.01);
  EXPECT_EQ(read("cam1.line_delay", {2e-5}).line_delay_s, 2e-5);
  EXPECT_EQ(read("cam1.line_delay", {}).rolling_shutter, 0);
}

TEST_F(CalibrationTest, RefusesBlocksThatDoNotFit) {
  Receive(Message(1, true));
  const auto error = [&](const char* name, std::vector<double> values) {
    selfcal_calibration* with = calibration_;
    EXPECT_EQ(
        selfcal_calibration_with_block(
            calibration_, name, values.data(), values.size(), &with, &error_),
        SELFCAL_INVALID_ARGUMENT);
    EXPECT_EQ(with, nullptr);
    return std::string(error_.message);
  };
  EXPECT_EQ(error("imu.colour", {1}), "name: there is no block 'imu.colour'");
  EXPECT_EQ(error("cam2.focal", {500, 500}),
            "name: there is no block 'cam2.focal'");
  EXPECT_EQ(error("cam1.focal", {500}),
            "size: 1 is not a number of values of cam1.focal");
  EXPECT_EQ(error("imu.gyro.scale", {}),
            "size: 0 is not a number of values of imu.gyro.scale");
  EXPECT_EQ(error("imu.accel.position", {1, 2, 3, 4}),
            "size: 4 is not a number of values of imu.accel.position");
  EXPECT_THAT(error("cam1.focal", {500, -1}),
              ::testing::HasSubstr("calibration.cameras[1].f"));
  EXPECT_EQ(selfcal_calibration_with_block(
                calibration_, "cam1.focal", nullptr, 2, nullptr, &error_),
            SELFCAL_INVALID_ARGUMENT);
}

TEST_F(CalibrationTest, CanBeMadeOfTheSameValues) {
  Receive(Message(1, true));
  selfcal_imu imu = {};
  imu.struct_size = sizeof(imu);
  selfcal_camera cameras[2] = {};
  const selfcal_camera* const pointers[2] = {&cameras[0], &cameras[1]};
  ASSERT_EQ(selfcal_calibration_get_imu(calibration_, &imu, nullptr), 0);
  for (std::int32_t j = 0; j < 2; ++j) {
    cameras[j].struct_size = sizeof(cameras[j]);
    ASSERT_EQ(
        selfcal_calibration_get_camera(calibration_, j, &cameras[j], nullptr),
        0);
  }
  selfcal_calibration* made = nullptr;
  ASSERT_EQ(selfcal_calibration_create(&imu, pointers, 2, &made, &error_), 0)
      << error_.message;
  EXPECT_EQ(selfcal_calibration_version(made), 0);
  const std::int32_t size = selfcal_calibration_component_count(made);
  EXPECT_EQ(size, selfcal_calibration_component_count(calibration_));
  for (std::int32_t i = 0; i < size; ++i) {
    selfcal_component one = {};
    one.struct_size = sizeof(one);
    selfcal_component other = one;
    selfcal_calibration_get_component(made, i, &one, nullptr);
    selfcal_calibration_get_component(calibration_, i, &other, nullptr);
    EXPECT_EQ(one.value, other.value) << one.name;
  }
  selfcal_calibration_destroy(made);

  // The optional parts of an IMU are kept.
  imu.gyro_g_sensitivity_size = 9;
  imu.gyro_g_sensitivity[5] = 2e-4;
  imu.accel_position_size = 3;
  imu.accel_position[1] = 0.03;
  ASSERT_EQ(selfcal_calibration_create(&imu, pointers, 2, &made, &error_), 0)
      << error_.message;
  EXPECT_EQ(selfcal_calibration_component_count(made), size + 9 + 3);
  selfcal_imu again = {};
  again.struct_size = sizeof(again);
  ASSERT_EQ(selfcal_calibration_get_imu(made, &again, nullptr), 0);
  EXPECT_EQ(again.gyro_g_sensitivity[5], 2e-4);
  EXPECT_EQ(again.accel_position_size, 3);
  EXPECT_EQ(again.accel_position[1], 0.03);
  selfcal_calibration_destroy(made);
  imu.accel_position_size = 10;
  EXPECT_EQ(selfcal_calibration_create(&imu, pointers, 2, &made, &error_),
            SELFCAL_INVALID_ARGUMENT);
  EXPECT_STREQ(error_.message,
               "imu.accel_position_size: is 10, must be 0 to 9");
  imu.accel_position_size = 4;
  EXPECT_EQ(selfcal_calibration_create(&imu, pointers, 2, &made, &error_),
            SELFCAL_INVALID_ARGUMENT);
  imu.accel_position_size = 0;

  cameras[1].model = "pinhole";
  EXPECT_EQ(selfcal_calibration_create(&imu, pointers, 2, &made, &error_),
            SELFCAL_INVALID_ARGUMENT);
  EXPECT_STREQ(error_.message, "cameras[1].model: 'pinhole' is not known");
  EXPECT_EQ(made, nullptr);
  cameras[1].model = "equidistant";
  cameras[1].distortion_size = 9;
  EXPECT_EQ(selfcal_calibration_create(&imu, pointers, 2, &made, &error_),
            SELFCAL_INVALID_ARGUMENT);
  cameras[1].distortion_size = 4;
  cameras[1].f[0] = -1;
  EXPECT_EQ(selfcal_calibration_create(&imu, pointers, 2, &made, &error_),
            SELFCAL_INVALID_ARGUMENT);
  EXPECT_THAT(error_.message, testing::HasSubstr("cameras[1].f"));
}

TEST_F(CalibrationTest, ACopyOutlivesTheWatch) {
  Receive(Message(3, true));
  selfcal_calibration* const copy = selfcal_calibration_copy(calibration_);
  selfcal_calibration_destroy(calibration_);
  calibration_ = nullptr;
  selfcal_watch_destroy(watch_);
  watch_ = nullptr;
  EXPECT_EQ(selfcal_calibration_version(copy), 3);
  selfcal_calibration_destroy(copy);
}

TEST_F(CalibrationTest, HasTheVerdictOnIt) {
  const std::pair<v1::Verdict::Kind, std::int32_t> kinds[] = {
      {v1::Verdict::GOOD, SELFCAL_VERDICT_GOOD},
      {v1::Verdict::WEAK, SELFCAL_VERDICT_WEAK},
      {v1::Verdict::NOT_TRUSTWORTHY, SELFCAL_VERDICT_NOT_TRUSTWORTHY},
      {v1::Verdict::FACTORY, SELFCAL_VERDICT_FACTORY},
      {v1::Verdict::UNKNOWN, SELFCAL_VERDICT_UNKNOWN},
      {static_cast<v1::Verdict::Kind>(77), SELFCAL_VERDICT_UNKNOWN}};
  for (const auto& [kind, expected] : kinds) {
    v1::Calibration message = Message(7, false);
    message.mutable_verdict()->set_kind(kind);
    for (const char* reason : {"One.", "Two."}) {
      message.mutable_verdict()->add_sentences(reason);
    }
    Receive(message);
    EXPECT_EQ(selfcal_calibration_get_verdict(calibration_), expected);
    ASSERT_EQ(selfcal_calibration_reason_count(calibration_), 2);
    EXPECT_STREQ(selfcal_calibration_reason(calibration_, 1), "Two.");
    EXPECT_EQ(selfcal_calibration_reason(calibration_, 2), nullptr);
    EXPECT_EQ(selfcal_calibration_reason(calibration_, -1), nullptr);
    selfcal_watch_destroy(watch_);
    watch_ = nullptr;
    selfcal_calibration_destroy(calibration_);
    calibration_ = nullptr;
    count_ = 0;
  }
  EXPECT_EQ(selfcal_calibration_get_verdict(nullptr), SELFCAL_VERDICT_UNKNOWN);
  EXPECT_EQ(selfcal_calibration_reason_count(nullptr), 0);
  EXPECT_EQ(selfcal_calibration_reason(nullptr, 0), nullptr);
}

TEST_F(CalibrationTest, ReachesAProgramInCxx11) {
  v1::Calibration message = Message(5, true);
  message.mutable_verdict()->set_kind(v1::Verdict::WEAK);
  message.mutable_verdict()->add_sentences("Little is known of it.");
  daemon_.Publish(message);
  const Cxx11Calibration seen = WatchInCxx11(daemon_.target());
  EXPECT_EQ(seen.version, 5);
  EXPECT_EQ(seen.callbacks, 1u);
  EXPECT_EQ(seen.verdict, SELFCAL_VERDICT_WEAK);
  EXPECT_THAT(seen.reasons, ::testing::ElementsAre("Little is known of it."));
  EXPECT_EQ(seen.focal_x, 400);
  EXPECT_EQ(seen.model, "fov");
  const auto size = static_cast<std::size_t>(TangentSize(Theta()));
  ASSERT_EQ(seen.sigmas.size(), size);
  EXPECT_EQ(seen.sigmas[1], std::sqrt(3.0));
  ASSERT_EQ(seen.covariance.size(), size * size);
  Eigen::Vector2d expected;
  ASSERT_TRUE(Project(Theta().cameras[0], {0.1, 0.2, 1}, &expected, nullptr));
  EXPECT_EQ(Eigen::Vector2d(seen.z_px), expected);
  EXPECT_FALSE(seen.behind);
  EXPECT_EQ(seen.code, SELFCAL_OUT_OF_RANGE);
}

TEST(CalibrationCxx11, ThrowsWhatIsWrongWithTheOptions) {
  EXPECT_EQ(ErrorInCxx11(), "options.rig: is required");
}

}  // namespace
}  // namespace selfcal::testing_c
