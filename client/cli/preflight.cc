// preflight: whether a recording is wrong in one of the usual ways.
#include <fmt/format.h>

#include <memory>
#include <string>
#include <vector>

#include "client/cli/commands.h"
#include "client/cli/diagnosis_text.h"
#include "client/cli/recording_input.h"
#include "client/cli/rig_input.h"
#include "core/preflight/diagnose.h"
#include "proto/convert.h"

namespace selfcal::client {
namespace {

struct PreflightOptions {
  RecordingInput recording;
  std::string rig_file;  // empty: the sensors of the map
};

absl::Status Invalid(const std::string& source,
                     const std::vector<Violation>& violations) {
  std::string text = source + " is not valid:";
  for (const Violation& violation : violations) {
    text += fmt::format("\n  {}: {}", violation.field, violation.message);
  }
  return absl::InvalidArgumentError(text);
}

absl::StatusOr<Rig> ReadRigFile(const std::string& file) {
  RigInput input;
  input.files = {file};
  std::vector<Loss> losses;  // of other tools' files: this is our own
  const auto message = ReadRig(input, &losses);
  if (!message.ok()) return message.status();
  Rig rig;
  auto violations = FromProto(*message, "", &rig);
  if (violations.empty()) violations = Validate(rig);
  if (!violations.empty()) return Invalid(file, violations);
  return rig;
}

int Preflight(const Context& context, const PreflightOptions& options) {
  auto recording = ReadRecording(options.recording);
  if (!recording.ok()) return FailInput(recording.status());
  Rig rig = recording->rig;
  if (!options.rig_file.empty()) {
    auto read = ReadRigFile(options.rig_file);
    if (!read.ok()) return FailInput(read.status());
    rig = *std::move(read);
  } else if (auto violations = Validate(rig.factory, "sensors");
             !violations.empty()) {
    return FailInput(Invalid("the map's sensors.yaml", violations));
  }
  const Diagnosis diagnosis = Diagnose(rig, rig.factory, recording->segments);
  if (context.json) {
    context.PrintJson(DiagnosisJson(diagnosis));
  } else {
    PrintText(context.terminal ? DiagnosisText(diagnosis)
                               : DiagnosisRecords(diagnosis));
  }
  return diagnosis.findings.empty() ? kDone : kFailed;
}

}  // namespace

void AddPreflightCommand(CLI::App* app, Context* context) {
  CLI::App* preflight = app->add_subcommand(
      "preflight",
      "Check VI-maps for the usual mistakes: axes, units, gravity, time "
      "offset, "
      "lost samples, saturation, extrinsics, focal length, landmarks. Exits "
      "with 0 if nothing is found, with 1 if something is. Needs no daemon");
  const auto options = std::make_shared<PreflightOptions>();
  AddRecordingOptions(preflight, &options->recording);
  preflight->add_option(
      "--rig",
      options->rig_file,
      "What is stated about the rig: proto3 JSON of selfcal.v1.Rig, \"-\" is "
      "standard input [the map's own sensors]");
  preflight->callback([context, options] {
    context->command = [context, options] {
      return Preflight(*context, *options);
    };
  });
}

}  // namespace selfcal::client
