#include "client/cli/recorded_sessions.h"

#include <fmt/format.h>

#include <cstdint>
#include <filesystem>
#include <utility>

#include "client/cli/context.h"
#include "client/cli/positive_number.h"
#include "client/cli/temperature_option.h"
#include "client/import/vi_map.h"

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

std::string SessionName(const std::string& path, std::int64_t first_ns) {
  return fmt::format("{}-{}", NameOf(path), first_ns / 1'000'000);
}

absl::StatusOr<RecordedSession> OpenMap(const std::string& path,
                                        const RecordingsInput& input) {
  ViMapInput map;
  map.folders = {path};
  map.builder.keyframes = input.keyframes;
  auto read = ReadViMapSegments(map);
  if (!read.ok()) return read.status();
  RecordedSession session;
  session.name =
      SessionName(path, read->segments.front().keyframes.front().t_ns);
  for (MotionSegment& segment : read->segments) {
    segment.key.session = session.name;
    segment.temperature_c = input.temperature_c;
  }
  session.map = *std::move(read);
  return session;
}

absl::StatusOr<RecordedSession> OpenSession(const std::string& path,
                                            const RecordingsInput& input) {
  if (IsViMap(path)) return OpenMap(path, input);
  auto recording = OpenRecording(path, input.topics);
  if (!recording.ok()) return recording.status();
  for (const std::string& problem : (*recording)->problems()) {
    PrintError(problem);
  }
  if (const auto differences = StampDifferences(**recording)) {
    PrintError(fmt::format("{}: {}", path, *differences));
  }
  RecordedSession session;
  session.name =
      SessionName(path, (*recording)->cameras().front().image_times_ns.front());
  session.recording = *std::move(recording);
  return session;
}

}  // namespace

int CameraCount(const RecordedSession& session) {
  return static_cast<int>(session.map ? session.map->rig.factory.cameras.size()
                                      : session.recording->cameras().size());
}

std::span<const ImuSample> Readings(const RecordedSession& session) {
  if (session.map) return session.map->segments.front().imu;
  return session.recording->imu();
}

absl::Status CheckImus(const RecordedSession& session, bool rig_has_second) {
  if (!rig_has_second) return absl::OkStatus();
  if (session.recording && !session.recording->imu1().empty()) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(fmt::format(
      "{}: there are no readings of the second IMU that the calibration has: a "
      "bag needs --imu-topic for both, a folder imu1.csv; or leave the second "
      "IMU out of the calibration",
      session.name));
}

void AddRecordingsOptions(CLI::App* command, RecordingsInput* input) {
  command
      ->add_option("RECORDING",
                   input->paths,
                   "A bag of ROS 1 or ROS 2 (MCAP, SQLite), a folder in the "
                   "format of EuRoC or TUM-VI, a folder of images with "
                   "cam0.csv and imu.csv, a folder of tracks with tracks.csv "
                   "and imu.csv, or a VI-map of maplab; each is a session")
      ->required();
  command
      ->add_option("--camera-topic",
                   input->topics.camera_topics,
                   "Topic of a camera's images; repeatable, in the order of "
                   "the calibration's cameras [all topics of images]")
      ->allow_extra_args(false);
  command
      ->add_option("--imu-topic",
                   input->topics.imu_topics,
                   "Topic of the readings [the only one of its type]; given "
                   "again, that of a second IMU")
      ->allow_extra_args(false);
  command->add_option("--keyframes", input->keyframes, "Keyframes per segment")
      ->check(CLI::Range(20, 2000))
      ->capture_default_str();
  command
      ->add_option("--keyframe-rate",
                   input->keyframe_rate_hz,
                   "Maximum keyframe rate; maps keep theirs [Hz]")
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
    auto session = OpenSession(path, input);
    if (!session.ok()) return session.status();
    sessions.push_back(*std::move(session));
    const int cameras = CameraCount(sessions.back());
    const int first = CameraCount(sessions.front());
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
