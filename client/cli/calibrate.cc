// calibrate: from recordings to a calibration, with a daemon of its own.
#include <fmt/format.h>
#include <google/protobuf/util/time_util.h>
#include <malloc.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "client/cli/calibration_results.h"
#include "client/cli/choice.h"
#include "client/cli/clock_alignment.h"
#include "client/cli/commands.h"
#include "client/cli/device_data.h"
#include "client/cli/diagnosis_text.h"
#include "client/cli/foreign_files.h"
#include "client/cli/motion_advice.h"
#include "client/cli/positive_number.h"
#include "client/cli/preflight_subject.h"
#include "client/cli/progress.h"
#include "client/cli/recorded_rig.h"
#include "client/cli/recorded_sessions.h"
#include "client/cli/recording_feed.h"
#include "client/cli/rig_input.h"
#include "client/cli/rig_options.h"
#include "client/cli/run_following.h"
#include "client/odometry/start.h"
#include "client/process/daemon_process.h"
#include "client/text/text.h"
#include "core/model/camera_model.h"
#include "proto/convert.h"
#include "proto/resource_names.h"
#include "selfcal/v1/recalibration.grpc.pb.h"
#include "selfcal/v1/rig.grpc.pb.h"
#include "selfcal/v1/segment.pb.h"

namespace selfcal::client {
namespace {

namespace fs = std::filesystem;

// Segments that the pre-flight check looks at.
constexpr int kPreflightSegments = 15;

struct CalibrateInput {
  RecordingsInput recordings;
  RigInput rig;
  std::vector<std::string> from;  // the tool, and its files
  std::string output;
  std::string camera_model = "radial-tangential";  // of cameras not stated
  std::string daemon;  // path of selfcald; empty: found
};

// The daemon beside this program, as both are installed, or in the build tree,
// or on the path.
std::string FindDaemon() {
  std::error_code error;
  const fs::path self = fs::read_symlink("/proc/self/exe", error);
  std::vector<fs::path> places = {
      self.parent_path() / "selfcald",
      self.parent_path() / "../../server/daemon/selfcald"};
  const char* const path = std::getenv("PATH");
  std::string rest = path == nullptr ? "" : path;
  while (!rest.empty()) {
    const std::size_t colon = std::min(rest.find(':'), rest.size());
    if (colon > 0) {
      places.push_back(fs::path(rest.substr(0, colon)) / "selfcald");
    }
    rest.erase(0, colon + 1);
  }
  for (const fs::path& place : places) {
    if (access(place.c_str(), X_OK) == 0) return place.lexically_normal();
  }
  return "selfcald";
}

// Requires a name that the command line has checked.
DistortionModel ModelNamed(const std::string& name) {
  const auto models = DistortionModels();
  return *std::find_if(
      models.begin(), models.end(), [&](DistortionModel model) {
        return DistortionName(model) == name;
      });
}

// Aligns the clocks of the first recording, and replaces the calibration of the
// rig by a start that it gives.
int MoveToStart(std::optional<double> temperature_c,
                RecordedSession* first,
                RecordedRig* recorded) {
  Rig known;
  const auto faults = FromProto(recorded->rig, "rig", &known);
  if (!faults.empty()) return kDone;  // the daemon lists them
  // A start replaces the prior mean of the rig as well.
  known.factory = PriorMean(known);
  known.prior_mean.reset();
  // Blocks that the daemon would add, and groups.
  AddEstimatedBlocks(known.blocks, &known.factory);
  known.groups = DefaultGroups(known.blocks, known.factory);
  const absl::Status aligned =
      AlignClocks(known.factory, recorded->unknown.front(), first);
  if (!aligned.ok()) return FailInput(aligned);
  Progress progress("start");
  progress.Say("calibrating on the first 40 s");
  const auto start = FindStart(
      first->recording.get(), known, recorded->unknown, temperature_c);
  // Tracking needs less memory than the calibration that has ended: the rest is
  // returned.
  malloc_trim(0);
  progress.Clear();
  if (start.ok()) {
    *recorded->rig.mutable_factory() = ToProto(start->theta);
    recorded->rig.clear_prior_mean();
    return kDone;
  }
  const bool needed = std::any_of(
      recorded->unknown.begin(),
      recorded->unknown.end(),
      [](const UnknownOfCamera& one) { return one.rotation || one.focal; });
  if (needed || !absl::IsNotFound(start.status())) {
    return FailInput(start.status());
  }
  PrintError(fmt::format("no better start than the given one was found: {}",
                         std::string(start.status().message())));
  return kDone;
}

// Creates the rig from what the command line and the recordings say, unless the
// state has it already.
int EnsureRig(Context* context,
              const CalibrateInput& input,
              RecordedSession* first) {
  v1::Rig existing;
  grpc::Status status = ReadDevice(context, *input.rig.id, &existing);
  if (status.ok()) return kDone;
  if (status.error_code() != grpc::StatusCode::NOT_FOUND) {
    return Fail(*context, status);
  }
  std::vector<Loss> losses;
  auto recorded = ReadRecordedRig(
      input.rig, input.from, ModelNamed(input.camera_model), *first, &losses);
  PrintLosses(losses);
  if (!recorded.ok()) return FailInput(recorded.status());
  const absl::Status imus =
      CheckImus(*first, recorded->rig.factory().has_imu1());
  if (!imus.ok()) return FailInput(imus);
  if (!first->map) {
    const int moved =
        MoveToStart(input.recordings.temperature_c, first, &*recorded);
    if (moved != kDone) return moved;
  }
  using RigService = v1::RigService::StubInterface;
  const auto stub = v1::RigService::NewStub(context->Channel());
  v1::CreateRigRequest request;
  *request.mutable_rig() = recorded->rig;
  v1::Rig created;
  status =
      Call<RigService>(stub.get(), &RigService::CreateRig, request, &created);
  return status.ok() ? kDone : Fail(*context, status);
}

// Calibrates on all segments, unless a run has succeeded since the last of them
// came, and shows the result.
int Recalibrate(Context* context, const std::string& rig) {
  using Service = v1::RecalibrationService::StubInterface;
  const auto stub = v1::RecalibrationService::NewStub(context->Channel());
  v1::Recalibration last;
  v1::Segment newest;
  grpc::Status status = ReadNewestRun(stub.get(), rig, &last);
  if (status.ok()) status = ReadNewestSegment(context, rig, "", &newest);
  if (!status.ok()) return Fail(*context, status);
  if (last.state() == v1::Recalibration::SUCCEEDED &&
      newest.receive_time() <= last.create_time()) {
    return FollowRun(context, stub.get(), std::move(last));
  }
  v1::StartRecalibrationRequest request;
  request.set_parent(RigName(rig));
  request.set_force(true);
  v1::Recalibration run;
  status =
      Call<Service>(stub.get(), &Service::StartRecalibration, request, &run);
  return status.ok() ? FollowRun(context, stub.get(), std::move(run))
                     : Fail(*context, status);
}

void WarnOfMistakes(Context* context, const std::string& rig) {
  PreflightSubject subject;
  const grpc::Status read =
      ReadPreflightSubject(context, rig, kPreflightSegments, &subject);
  if (read.ok()) {
    WarnOf(Diagnose(subject.rig, subject.theta, subject.segments));
  }
}

// Says what is still to be recorded, as `rig coach` does, and leaves it beside
// the report. Predictions are for the active version.
int WriteWhatToRecord(Context* context,
                      const std::string& rig,
                      const fs::path& folder) {
  v1::AdviseMotionResponse response;
  const grpc::Status status = AskForAdvice(context, rig, 1, &response);
  if (!status.ok()) return Fail(*context, status);
  std::string text = MissingText(response);
  const absl::Status written =
      WriteTextFiles({{"what_to_record.txt", text}},
                     {(folder / "what_to_record.txt").string()},
                     true);
  text.pop_back();
  PrintError(text);
  return written.ok() ? kDone : FailInput(written);
}

int FeedAndCalibrate(Context* context,
                     const CalibrateInput& input,
                     std::vector<RecordedSession>* sessions) {
  const int ensured = EnsureRig(context, input, &sessions->front());
  if (ensured != kDone) return ensured;
  FeedCounts counts;
  for (RecordedSession& session : *sessions) {
    const int code = FeedRecording(
        context, *input.rig.id, input.recordings, &session, &counts);
    if (code != kDone) return code;
  }
  PrintError(fmt::format("{} stored, {} left out",
                         CountText(counts.sent, "segment"),
                         counts.failed));
  if (counts.sent == 0 && !counts.continued) {
    return FailInput(absl::InvalidArgumentError(
        "no motion was found in the recordings: move the device about all "
        "axes, in front of a textured scene, for at least 20 s"));
  }
  WarnOfMistakes(context, *input.rig.id);
  const int code = Recalibrate(context, *input.rig.id);
  const int written =
      WriteResults(context, *input.rig.id, input.output, input.rig.imu_rate_hz);
  const int advised = WriteWhatToRecord(context, *input.rig.id, input.output);
  if (code != kDone) return code;
  return written != kDone ? written : advised;
}

int Calibrate(Context* context, CalibrateInput input) {
  auto sessions = OpenSessions(input.recordings);
  if (!sessions.ok()) return FailInput(sessions.status());
  std::error_code error;
  const fs::path state = fs::path(input.output) / "state";
  fs::create_directories(state, error);
  if (error) {
    return FailInput(absl::InvalidArgumentError(fmt::format(
        "{}: cannot be created: {}", state.string(), error.message())));
  }
  if (!input.rig.imu_rate_hz) {
    input.rig.imu_rate_hz = ImuRate(Readings(sessions->front()));
  }
  const auto daemon =
      DaemonProcess::Start(input.daemon.empty() ? FindDaemon() : input.daemon,
                           fs::absolute(state).lexically_normal());
  if (!daemon.ok()) {
    PrintError(std::string(daemon.status().message()));
    return kFailed;
  }
  context->target = {.address = (*daemon)->target()};
  const absl::Status connected = context->Connect();
  if (!connected.ok()) return FailInput(connected);
  return FeedAndCalibrate(context, input, &*sessions);
}

}  // namespace

void AddCalibrate(CLI::App* app, Context* context) {
  CLI::App* command = app->add_subcommand(
      "calibrate",
      "Calibrate on recordings of images and readings: tracks features, "
      "estimates the motion (a map of maplab has both), keeps the most "
      "informative segments and calibrates on them; needs no daemon. A further "
      "call with the same --output continues. Exits with 0 if the result is "
      "good, with 5 if it is weak, with 1 if it is not trustworthy");
  const auto input = std::make_shared<CalibrateInput>();
  input->rig.id = "device";
  AddRecordingsOptions(command, &input->recordings);
  command->add_option("--output",
                      input->output,
                      "Folder for the report, the calibration in the files of "
                      "every tool that can express it, and the state, which "
                      "`selfcald --state-dir` can go on with");
  command
      ->add_option("--from",
                   input->from,
                   "TOOL FILE...: begin with the calibration in files of this "
                   "tool, e.g. kalibr camchain-imucam.yaml imu.yaml [what the "
                   "recording states]")
      ->expected(2, 100);
  command
      ->add_option("--extrinsics",
                   input->rig.extrinsics,
                   "Pose of a camera, as cam0=PX,PY,PZ,QX,QY,QZ,QW: the "
                   "transform that takes points from the IMU's frame to the "
                   "camera's (z forward), as tf shows it; repeatable")
      ->allow_extra_args(false);
  std::vector<std::string> models;
  for (const DistortionModel model : DistortionModels()) {
    models.emplace_back(DistortionName(model));
  }
  command
      ->add_option("--camera-model",
                   input->camera_model,
                   "Model of a camera without a calibration, whose values are "
                   "guessed then: a lens that sees 100 degrees or more needs "
                   "another than the radial-tangential ones")
      ->check(OneOf(models))
      ->capture_default_str();
  command
      ->add_option("--cameras",
                   input->rig.cameras,
                   "With --from: only these cameras of the files, e.g. "
                   "cam0,cam2 [all]")
      ->delimiter(',')
      ->allow_extra_args(false);
  CLI::Option* const imu_rate =
      command
          ->add_option("--imu-rate",
                       input->rig.imu_rate_hz,
                       "Rate of the IMU, for noise that is stated per reading "
                       "[that of the recording, Hz]")
          ->check(AboveZero());
  AddRigOverrides(command, imu_rate, &input->rig);
  command->add_option(
      "--selfcald",
      input->daemon,
      "The program selfcald [beside this program, or on the path]");
  command->callback([context, input] {
    if (input->output.empty()) {
      throw CLI::ValidationError(
          "--output",
          "is required, for recordings; a rig of a daemon is calibrated by "
          "`selfcal run start RIG`");
    }
    context->command = [context, input] { return Calibrate(context, *input); };
  });
}

}  // namespace selfcal::client
