// The command line as a user sees it, against a daemon with canned answers.
#pragma once

#include <google/protobuf/util/json_util.h>
#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

#include "client/cli/commands.h"
#include "core/model/rig.h"
#include "proto/convert.h"
#include "test/client/cli/canned_daemon.h"
#include "test/support/files.h"
#include "test/support/temp_folder.h"

namespace selfcal::client {

struct Outcome {
  int code;
  std::string out;
  std::string err;
};

inline Outcome Selfcal(const std::vector<std::string>& arguments) {
  std::vector<const char*> argv = {"selfcal"};
  for (const std::string& argument : arguments) {
    argv.push_back(argument.c_str());
  }
  testing::internal::CaptureStdout();
  testing::internal::CaptureStderr();
  const int code = RunCommandLine(static_cast<int>(argv.size()), argv.data());
  std::string out = testing::internal::GetCapturedStdout();
  return {code, std::move(out), testing::internal::GetCapturedStderr()};
}

inline Rig ARig(const std::string& id) {
  Rig rig;
  rig.id = id;
  rig.factory.cameras.resize(1);
  CameraCalibration& camera = rig.factory.cameras[0];
  camera.f = {255, 256};
  camera.c = {320, 240};
  camera.distortion << 0.9;
  camera.width_px = 640;
  camera.height_px = 480;
  return rig;
}

inline v1::Calibration Version(std::int64_t version) {
  v1::Calibration calibration;
  calibration.set_version(version);
  calibration.set_state(v1::Calibration::ACTIVE);
  auto* estimate = calibration.add_estimates();
  estimate->set_component("cam0.focal.x");
  estimate->set_unit("px");
  estimate->set_value(255.1234);
  estimate->set_sigma(0.034);
  if (version == 1) return calibration;
  calibration.mutable_provenance()->set_base_version(version - 1);
  calibration.mutable_provenance()->add_segments("rigs/device/segments/a~0");
  auto* temperature = calibration.mutable_provenance()->mutable_temperature();
  temperature->set_segments(1);
  temperature->set_mean_c(21.5);
  temperature->set_min_c(20);
  temperature->set_max_c(23);
  calibration.mutable_solver()->set_status("converged");
  auto* part = calibration.mutable_solver()->add_held_constant()->add_parts();
  part->set_component("cam0.p_CI.z");
  part->set_weight(1);
  auto* noise = calibration.mutable_solver()->add_noise_factors();
  noise->set_kind("pixel");
  noise->set_factor(1.234);
  noise->set_log_sigma(0.02);
  noise->set_determined(true);
  noise = calibration.mutable_solver()->add_noise_factors();
  noise->set_kind("gyro_bias_walk");
  noise = calibration.mutable_solver()->add_noise_factors();
  noise->set_kind("imu1_accel");
  return calibration;
}

class Commands : public ::testing::Test {
 protected:
  Outcome Selfcal(std::vector<std::string> arguments) const {
    arguments.push_back("--target");
    arguments.push_back(daemon_.target);
    return client::Selfcal(arguments);
  }
  // The document on stdout as a message.
  template <typename Message>
  static Message Parse(const std::string& json) {
    Message message;
    const auto status =
        google::protobuf::util::JsonStringToMessage(json, &message);
    EXPECT_TRUE(status.ok()) << status.ToString() << json;
    return message;
  }
  std::string WriteFile(const std::string& text) const {
    std::string name = temp_folder_.File("rig.json");
    WriteBytes(name, text);
    return name;
  }

  const TempFolder temp_folder_;
  CannedDaemon daemon_;
};

}  // namespace selfcal::client
