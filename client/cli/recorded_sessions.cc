#include "client/cli/recorded_sessions.h"

#include <fmt/format.h>

#include <filesystem>
#include <utility>

#include "client/cli/context.h"
#include "client/cli/positive_number.h"
#include "client/cli/temperature_option.h"

namespace selfcal::client {
namespace {

// The last part of the path; characters that a session cannot have become '_'.
std::string NameOf(const std::string& path) {
  std::filesystem::path full(path);
  if (!full.has_filename()) full = full.parent_path();
  std::string name = full.stem().string();
  if (name == "." || name == "..") {
    name = std::filesystem::absolute(full).lexically_normal().stem().string();
  }
  constexpr std::size_t kMostBytes = 100;
  name.resize(std::min(name.size(), kMostBytes));
  for (char& c : name) {
    if (c <= ' ' || c > '~' || c == '"' || c == '\\') c = '_';
  }
  return name.empty() ? "recording" : name;
}

}  // namespace

void AddRecordingsOptions(CLI::App* command, RecordingsInput* input) {
  command
      ->add_option("RECORDING",
                   input->paths,
                   "A bag of ROS 1 or ROS 2 (MCAP, SQLite), a folder in the "
                   "format of EuRoC or TUM-VI, or a folder of images with "
                   "cam0.csv and imu.csv; each is a session")
      ->required();
  command
      ->add_option("--camera-topic",
                   input->topics.camera_topics,
                   "Topic of a camera's images; repeatable, in the order of "
                   "the calibration's cameras [all topics of images]")
      ->allow_extra_args(false);
  command->add_option("--imu-topic",
                      input->topics.imu_topic,
                      "Topic of the readings [the only one of its type]");
  command->add_option("--keyframes", input->keyframes, "Keyframes per segment")
      ->check(CLI::Range(20, 2000))
      ->capture_default_str();
  command
      ->add_option("--keyframe-rate",
                   input->keyframe_rate_hz,
                   "Keyframes are at most so many in a second [Hz]")
      ->check(AboveZero())
      ->capture_default_str();
  AddTemperature(command,
                 "Temperature of the device during the recordings",
                 &input->temperature_c);
}

absl::StatusOr<std::vector<RecordedSession>> OpenSessions(
    const RecordingsInput& input) {
  std::vector<RecordedSession> sessions;
  for (const std::string& path : input.paths) {
    auto recording = OpenRecording(path, input.topics);
    if (!recording.ok()) return recording.status();
    for (const std::string& problem : (*recording)->problems()) {
      PrintError(problem);
    }
    if (const auto differences = StampDifferences(**recording)) {
      PrintError(fmt::format("{}: {}", path, *differences));
    }
    const std::string name = fmt::format(
        "{}-{}",
        NameOf(path),
        (*recording)->cameras().front().image_times_ns.front() / 1'000'000);
    sessions.push_back({name, *std::move(recording), false});
    const std::size_t cameras = sessions.back().recording->cameras().size();
    const std::size_t first = sessions.front().recording->cameras().size();
    if (cameras != first) {
      return absl::InvalidArgumentError(
          fmt::format("{} has {} cameras and {} has {}: recordings of one "
                      "device have the same",
                      input.paths.front(),
                      first,
                      path,
                      cameras));
    }
  }
  return sessions;
}

}  // namespace selfcal::client
