#include <fmt/format.h>
#include <google/protobuf/struct.pb.h>

#include <memory>
#include <optional>
#include <string>

#include "client/cli/commands.h"
#include "client/cli/device_data.h"
#include "client/cli/foreign_files.h"
#include "client/cli/temperature_option.h"

namespace selfcal::client {
namespace {

struct ExportInput {
  std::string rig;
  std::string version = "active";
  std::string format;
  std::string output;
  std::optional<double> imu_rate_hz;
  std::optional<double> temperature_c;
  bool strict = false;
  bool force = false;
};

google::protobuf::Struct FilesMessage(const std::vector<std::string>& paths,
                                      const std::vector<Loss>& losses) {
  google::protobuf::Struct message;
  auto* files = (*message.mutable_fields())["files"].mutable_list_value();
  for (const std::string& path : paths) {
    files->add_values()->set_string_value(path);
  }
  auto* list = (*message.mutable_fields())["losses"].mutable_list_value();
  for (const Loss& loss : losses) {
    auto& fields =
        *list->add_values()->mutable_struct_value()->mutable_fields();
    fields["name"].set_string_value(loss.name);
    fields["text"].set_string_value(loss.text);
    fields["changes_prediction"].set_bool_value(loss.changes_prediction);
  }
  return message;
}

int ExportCalibration(Context* context, const ExportInput& input) {
  DeviceVersion source;
  const grpc::Status read = ReadDeviceVersion(
      context, input.rig, input.version, &source, input.temperature_c);
  if (!read.ok()) return Fail(*context, read);
  const auto exported = ExportRig(input.format,
                                  source.rig,
                                  source.theta,
                                  {.imu_rate_hz = input.imu_rate_hz});
  if (!exported.ok()) {
    PrintError(std::string(exported.status().message()));
    return kFailed;
  }
  PrintLosses(exported->losses);
  if (input.strict && ChangesPrediction(exported->losses)) {
    PrintError(
        "nothing was written: --strict is set, and the export has losses");
    return kFailed;
  }
  const std::vector<std::string> paths =
      OutputPaths(exported->files, input.output);
  const absl::Status written =
      WriteTextFiles(exported->files, paths, input.force);
  if (!written.ok()) return FailInput(written);
  if (context->json) {
    context->PrintJson(FilesMessage(paths, exported->losses));
    return kDone;
  }
  Table table({{"file"}});
  for (const std::string& path : paths) table.Add({path});
  context->Print(table);
  return kDone;
}

}  // namespace

void AddCalibrationExport(CLI::App* calibrations, Context* context) {
  CLI::App* command = calibrations->add_subcommand(
      "export", "Write a version in the files of another tool");
  const auto input = std::make_shared<ExportInput>();
  command->add_option("RIG", input->rig)->required();
  command->add_option("VERSION", input->version, "A number, or active")
      ->capture_default_str();
  command->add_option("--format", input->format, "The tool")
      ->required()
      ->check(FormatNames());
  command
      ->add_option("--output",
                   input->output,
                   "The folder for the files; for a single file, its path or "
                   "its folder")
      ->required();
  command->add_option("--imu-rate",
                      input->imu_rate_hz,
                      "Rate of the IMU, for tools that need it [Hz]");
  AddTemperature(command, "Temperature of the values", &input->temperature_c);
  command->add_flag("--strict",
                    input->strict,
                    "Write nothing if the predictions of the tool would differ "
                    "from those of selfcal");
  command->add_flag("--force", input->force, "Overwrite existing files");
  command->callback([context, input] {
    context->command = [context, input] {
      return ExportCalibration(context, *input);
    };
  });
}

}  // namespace selfcal::client
