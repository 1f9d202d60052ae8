// preflight: checks a recording, or the segments that a device has sent, for
// the usual mistakes.
#include <fmt/format.h>

#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "client/cli/commands.h"
#include "client/cli/device_data.h"
#include "client/cli/diagnosis_text.h"
#include "client/cli/error_lines.h"
#include "client/cli/preflight_subject.h"
#include "client/cli/rig_input.h"
#include "client/cli/vi_map_input.h"
#include "core/preflight/diagnose.h"
#include "proto/convert.h"

namespace selfcal::client {
namespace {

struct PreflightOptions {
  ViMapInput map;
  std::string rig_file;  // empty: use the sensors of the map
  std::string device;    // rig of the daemon, instead of a recording
  int newest = 20;       // number of its segments to check
};

// The rig and the segments that are checked.
absl::Status Invalid(const std::string& source,
                     const std::vector<Violation>& violations) {
  return absl::InvalidArgumentError(source +
                                    " is not valid:" + ErrorLines(violations));
}

absl::StatusOr<Rig> ReadRigFile(const std::string& file) {
  RigInput input;
  input.files = {file};
  std::vector<Loss> losses;  // stays empty: the file is not of another tool
  const auto message = ReadRig(input, &losses);
  if (!message.ok()) return message.status();
  Rig rig;
  auto violations = FromProto(*message, "", &rig);
  if (violations.empty()) violations = Validate(rig);
  if (!violations.empty()) return Invalid(file, violations);
  return rig;
}

absl::Status FromViMap(const PreflightOptions& options,
                       PreflightSubject* subject) {
  auto map = ReadViMapSegments(options.map);
  if (!map.ok()) return map.status();
  subject->rig = map->rig;
  if (!options.rig_file.empty()) {
    auto read = ReadRigFile(options.rig_file);
    if (!read.ok()) return read.status();
    subject->rig = *std::move(read);
  } else if (auto violations = Validate(subject->rig.factory, "sensors");
             !violations.empty()) {
    return Invalid("the map's sensors.yaml", violations);
  }
  subject->theta = subject->rig.factory;
  subject->segments = std::move(map->segments);
  return absl::OkStatus();
}

int Preflight(Context* context, const PreflightOptions& options) {
  PreflightSubject subject;
  if (options.device.empty()) {
    const absl::Status read = FromViMap(options, &subject);
    if (!read.ok()) return FailInput(read);
  } else {
    const grpc::Status read =
        ReadPreflightSubject(context, options.device, options.newest, &subject);
    if (!read.ok()) return Fail(*context, read);
  }
  const Diagnosis diagnosis =
      Diagnose(subject.rig, subject.theta, subject.segments);
  if (context->json) {
    context->PrintJson(DiagnosisJson(diagnosis));
  } else {
    PrintText(context->terminal ? DiagnosisText(diagnosis)
                                : DiagnosisRecords(diagnosis));
  }
  return diagnosis.findings.empty() ? kDone : kFailed;
}

}  // namespace

CLI::App* AddPreflight(CLI::App* parent,
                       const std::string& name,
                       Context* context) {
  CLI::App* preflight = parent->add_subcommand(
      name,
      "Check VI-maps, or the segments that a device has sent, for the usual "
      "mistakes: axes, units, gravity, time offset, lost samples, saturation, "
      "extrinsics, focal length, landmarks. Exits with 0 if nothing is found, "
      "otherwise with 1");
  const auto options = std::make_shared<PreflightOptions>();
  AddViMapOptions(preflight, &options->map);
  CLI::Option* const folders = preflight->get_option("DIR")->required(false);
  CLI::Option* const rig = preflight->add_option(
      "--rig",
      options->rig_file,
      "The rig to check against: proto3 JSON of selfcal.v1.Rig, \"-\" is "
      "standard input [the sensors of the map]");
  CLI::Option* const device =
      preflight
          ->add_option("--device",
                       options->device,
                       "Check a rig of the daemon instead of VI-maps: its "
                       "newest segments, against the version they were "
                       "recorded with")
          ->excludes(folders)
          ->excludes(rig);
  preflight
      ->add_option("--newest",
                   options->newest,
                   "With --device: number of segments to check")
      ->check(CLI::Range(1, 500))
      ->capture_default_str()
      ->needs(device);
  preflight->callback([context, options] {
    if (options->device.empty() && options->map.folders.empty()) {
      throw CLI::RequiredError("DIR or --device");
    }
    context->command = [context, options] {
      return Preflight(context, *options);
    };
  });
  return preflight;
}

}  // namespace selfcal::client
