// selfcal-demo: shows how data of a device becomes a versioned calibration that
// survives a kill. `selfcal-demo stream` streams a simulated device to a daemon
// that is running.
#include <fmt/format.h>
#include <stdlib.h>

#include <CLI/CLI.hpp>
#include <cstdint>
#include <filesystem>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "client/demo/demo.h"
#include "client/demo/device.h"
#include "client/demo/report.h"
#include "client/demo/stream_device.h"

namespace {

struct Flags {
  std::string daemon;
  std::vector<std::string> vi_map;
  std::string json;
  std::string keep;
  std::uint64_t seed = 1;
  double seconds = 120;
  selfcal::client::RecordingOptions recording;
};

struct StreamFlags {
  selfcal::client::StreamOptions options;
  double turn_deg = 0;
  double focal_percent = 0;
};

// Creates the folder `keep`, or a temporary one. Prints errors.
std::optional<std::string> MakeFolder(const std::string& keep) {
  std::error_code error;
  if (!keep.empty()) {
    if (std::filesystem::create_directories(keep, error)) return keep;
    fmt::print(stderr,
               "cannot make the folder {}: {}\n",
               keep,
               error ? error.message() : "it is there already");
    return std::nullopt;
  }
  std::string folder =
      (std::filesystem::temp_directory_path() / "selfcal-demo-XXXXXX").string();
  if (mkdtemp(folder.data()) != nullptr) return folder;
  fmt::print(stderr, "cannot make a folder like {}\n", folder);
  return std::nullopt;
}

int Run(const Flags& flags) {
  using namespace selfcal::client;
  absl::StatusOr<Device> device =
      flags.vi_map.empty() ? SimulateDevice(flags.seed, flags.seconds)
                           : ReadDevice(flags.vi_map, flags.recording);
  if (!device.ok()) {
    fmt::print(stderr, "{}\n", std::string(device.status().message()));
    return 1;
  }
  const std::optional<std::string> folder = MakeFolder(flags.keep);
  if (!folder) return 1;
  Report report;
  const absl::Status status =
      RunDemo({.daemon = flags.daemon, .state_dir = *folder + "/state"},
              *device,
              &report);
  if (!status.ok()) {
    report.Fail(std::string(status.message()));
  }
  const bool stays = report.failed() || !flags.keep.empty();
  if (!report.failed()) report.Line("every step did what it says");
  if (stays) report.Line("the state stays in " + *folder + "/state");
  if (!stays) std::filesystem::remove_all(*folder);
  if (!flags.json.empty()) {
    if (const absl::Status written = report.WriteJson(flags.json);
        !written.ok()) {
      fmt::print(stderr, "{}\n", std::string(written.message()));
      return 1;
    }
  }
  return report.failed() ? 1 : 0;
}

int Stream(StreamFlags flags) {
  using namespace selfcal::client;
  flags.options.use.change = {
      .turn_rad = flags.turn_deg * std::numbers::pi / 180,
      .focal_relative = flags.focal_percent / 100};
  Report report;
  const absl::Status status = StreamDevice(flags.options, &report);
  if (status.ok()) return 0;
  fmt::print(stderr, "{}\n", std::string(status.message()));
  return 1;
}

CLI::App* AddStream(CLI::App* app, StreamFlags* flags) {
  CLI::App* stream = app->add_subcommand(
      "stream",
      "Stream a session of a simulated device to a daemon that is running");
  selfcal::client::StreamOptions& options = flags->options;
  stream
      ->add_option("--target",
                   options.target,
                   "The daemon, without TLS: unix:PATH or HOST:PORT")
      ->required();
  stream
      ->add_option(
          "--rig", options.rig, "Its rig, which is created if it is not there")
      ->required();
  stream->add_option("--seed", options.use.seed, "Of the device");
  stream
      ->add_option("--session",
                   options.use.session,
                   "Number of the session: another motion for each")
      ->check(CLI::Range(1, 1'000'000));
  stream->add_option("--seconds", options.use.seconds, "Its length [s]")
      ->check(CLI::Range(5.0, 3600.0));
  stream
      ->add_option("--turn-deg",
                   flags->turn_deg,
                   "The camera was turned by this angle [degrees]")
      ->check(CLI::Range(-10.0, 10.0));
  stream
      ->add_option("--focal-percent",
                   flags->focal_percent,
                   "The focal lengths are longer by this [%]")
      ->check(CLI::Range(-10.0, 10.0));
  return stream;
}

}  // namespace

int main(int argc, char** argv) {
  Flags flags;
  StreamFlags stream_flags;
  CLI::App app("From a device to a versioned calibration, as one watches it.");
  app.add_option("--daemon", flags.daemon, "Path of selfcald; required");
  app.add_option("--vi-map",
                 flags.vi_map,
                 "A real recording: a maplab VI-map folder, or several that "
                 "are consecutive submaps; without it, a simulated device");
  app.add_option("--json", flags.json, "Write all that is shown to this file");
  app.add_option(
      "--keep", flags.keep, "A new folder, in which the daemon's state stays");
  app.add_option("--seed", flags.seed, "Of the simulation");
  app.add_option("--seconds", flags.seconds, "Length of the simulation [s]")
      ->check(CLI::Range(40.0, 3600.0));
  app.add_option("--keyframes",
                 flags.recording.keyframes_per_segment,
                 "Keyframes of a segment of the recording")
      ->check(CLI::Range(2, 2000));
  app.add_option("--gyro-bias-walk",
                 flags.recording.gyro_bias_walk,
                 "Instead of the recording's [rad/s^2/sqrt(Hz)]");
  app.add_option("--accel-bias-walk",
                 flags.recording.accel_bias_walk,
                 "Instead of the recording's [m/s^3/sqrt(Hz)]");
  const CLI::App* stream = AddStream(&app, &stream_flags);
  CLI11_PARSE(app, argc, argv);
  if (stream->parsed()) return Stream(stream_flags);
  if (flags.daemon.empty()) return app.exit(CLI::RequiredError("--daemon"));
  return Run(flags);
}
