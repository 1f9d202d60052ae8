// selfcal-demo: shows how data of a device becomes a versioned calibration that
// survives a kill.
#include <fmt/format.h>
#include <stdlib.h>

#include <CLI/CLI.hpp>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "client/demo/demo.h"
#include "client/demo/device.h"
#include "client/demo/report.h"

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

}  // namespace

int main(int argc, char** argv) {
  Flags flags;
  CLI::App app("From a device to a versioned calibration, as one watches it.");
  app.add_option("--daemon", flags.daemon, "Path of selfcald")->required();
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
  CLI11_PARSE(app, argc, argv);
  return Run(flags);
}
