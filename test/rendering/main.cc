// Renders a recording with known truth into a folder in the format of EuRoC.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <ctime>
#include <exception>
#include <fstream>
#include <iterator>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "core/model/camera_model.h"
#include "test/core/simulation/rigs.h"
#include "test/rendering/euroc_folder.h"
#include "test/rendering/rendered_recording.h"

namespace selfcal {
namespace {

struct Arguments {
  std::string folder;
  std::string device = "handheld";
  std::string motion = "handheld";
  double seconds = 60;
  double excitation = 1;
  double exposure_ms = 0;
  double line_delay_us = 0;
  bool twin = false;
  bool second_imu = false;
  bool wrong_start = false;
  RenderOptions options;
};

Rig RigNamed(const std::string& device) {
  if (device == "handheld") return HandheldRig(device);
  if (device == "stereo") return StereoRig();
  for (const DistortionModel model : DistortionModels()) {
    if (device == DistortionName(model)) return LensRig(model);
  }
  throw std::runtime_error(
      "no device '" + device +
      "': handheld, stereo, or the name of a camera model");
}

std::unique_ptr<const Trajectory> ReadMotion(const std::string& path) {
  std::ifstream file(path);
  if (!file) throw std::runtime_error("cannot open " + path);
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  std::vector<TimedPose> poses;
  std::string error;
  std::unique_ptr<const Trajectory> trajectory;
  if (ParseTum(text, &poses, &error)) {
    trajectory = MakeSpline(poses, {}, &error);
  }
  if (!trajectory) throw std::runtime_error(path + ": " + error);
  return trajectory;
}

std::unique_ptr<const Trajectory> MotionNamed(const Arguments& arguments) {
  const std::uint64_t seed = arguments.options.seed;
  if (arguments.motion == "handheld") {
    return MakeHandheld(arguments.seconds, arguments.excitation, seed);
  }
  if (arguments.motion == "mixed") return MakeMixed(arguments.seconds, seed);
  if (arguments.motion == "rotation") {
    RotationInPlaceOptions options;
    options.excitation = arguments.excitation;
    return MakeRotationInPlace(arguments.seconds, options, seed);
  }
  return ReadMotion(arguments.motion);
}

void Define(CLI::App* app, Arguments* arguments) {
  RenderOptions& options = arguments->options;
  app->add_option("folder", arguments->folder, "Folder to write")->required();
  app->add_option("--device",
                  arguments->device,
                  "handheld, stereo, or a camera model (fov, unified, ...)");
  app->add_flag("--twin",
                arguments->twin,
                "With a second camera of the same kind, 11 cm to the right");
  app->add_flag("--second-imu",
                arguments->second_imu,
                "With a second IMU, 5 cm from the first");
  app->add_option("--motion",
                  arguments->motion,
                  "handheld, mixed, rotation, or a TUM file of poses");
  app->add_option("--seconds", arguments->seconds, "Length, but of a file")
      ->check(CLI::PositiveNumber);
  app->add_option("--excitation",
                  arguments->excitation,
                  "1 is vigorous, 0.1 calm, 0 at rest");
  app->add_option("--seed", options.seed);
  app->add_option("--image-rate", options.image_rate_hz)
      ->check(CLI::PositiveNumber);
  app->add_option("--imu-rate", options.imu_rate_hz)
      ->check(CLI::PositiveNumber);
  app->add_option("--exposure-ms", arguments->exposure_ms)
      ->check(CLI::NonNegativeNumber);
  app->add_option("--line-delay-us",
                  arguments->line_delay_us,
                  "Rolling shutter: delay of each row after the one before")
      ->check(CLI::NonNegativeNumber);
  app->add_flag("--wrong-start",
                arguments->wrong_start,
                "State a calibration that is off by 5 % in f, 10 px in c, 3 "
                "degrees, 5 cm and 20 ms instead of the truth");
  app->add_option("--boxes", options.scene.boxes);
  app->add_option("--moving-boxes", options.scene.moving_boxes);
  app->add_option("--moving-speed", options.scene.moving_speed_mps, "[m/s]");
  app->add_option("--vignetting", options.sensor.vignetting)
      ->check(CLI::Range(0.0, 1.0));
  app->add_option("--gain-amplitude", options.sensor.gain_amplitude);
  app->add_option("--gain-period", options.sensor.gain_period_s, "[s]");
  app->add_option("--full-well", options.sensor.full_well_e, "[electrons]");
  app->add_option("--read-noise", options.sensor.read_noise_e, "[electrons]");
}

int Run(Arguments arguments) {
  RenderOptions& options = arguments.options;
  options.exposure_s = arguments.exposure_ms * 1e-3;
  Rig rig = RigNamed(arguments.device);
  if (arguments.twin) rig = TwinRig(std::move(rig));
  if (arguments.second_imu) AddSecondImu(&rig);
  if (arguments.line_delay_us > 0) {
    for (CameraCalibration& camera : rig.factory.cameras) {
      camera.line_delay_s = arguments.line_delay_us * 1e-6;
    }
  }
  const std::clock_t begin = std::clock();
  const RenderedRecording recording(rig, MotionNamed(arguments), options);
  const int total = recording.cameras() * recording.images();
  const Calibration stated =
      arguments.wrong_start ? WrongStart(rig.factory) : rig.factory;
  WriteEurocFolder(recording, stated, arguments.folder, [&](int images) {
    if (images % 20 == 0 || images == total) {
      fmt::print(stderr, "\r{} of {} images", images, total);
    }
  });
  const double cpu_s =
      static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
  fmt::print(stderr,
             "\n{}: {} boxes, {:.0f} s of CPU time, {:.0f} ms for an image\n",
             arguments.folder,
             recording.scene().boxes.size(),
             cpu_s,
             1e3 * cpu_s / total);
  return 0;
}

}  // namespace
}  // namespace selfcal

int main(int argc, char** argv) {
  CLI::App app("Renders a recording with known truth (docs/recordings.md)");
  selfcal::Arguments arguments;
  selfcal::Define(&app, &arguments);
  CLI11_PARSE(app, argc, argv);
  try {
    return selfcal::Run(std::move(arguments));
  } catch (const std::exception& e) {
    fmt::print(stderr, "selfcal_render: {}\n", e.what());
    return 1;
  }
}
