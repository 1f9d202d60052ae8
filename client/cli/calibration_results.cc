#include "client/cli/calibration_results.h"

#include <fmt/format.h>

#include <filesystem>
#include <utility>
#include <vector>

#include "client/cli/device_data.h"
#include "client/cli/foreign_files.h"
#include "client/cli/report_file.h"
#include "client/formats/format.h"

namespace selfcal::client {
namespace {

namespace fs = std::filesystem;

// Writes files for the tools that can express the calibration. A tool that
// cannot is named with its reason.
absl::Status WriteForTools(const Rig& rig,
                           const Calibration& theta,
                           const fs::path& folder,
                           std::optional<double> imu_rate_hz) {
  for (const FormatInfo& format : Formats()) {
    const auto exported =
        ExportRig(format.name, rig, theta, {.imu_rate_hz = imu_rate_hz});
    if (!exported.ok()) {
      PrintError(fmt::format("no files for {}: {}",
                             format.name,
                             std::string(exported.status().message())));
      continue;
    }
    if (ChangesPrediction(exported->losses)) {
      PrintError(fmt::format("{} differs:", format.name));
      PrintLosses(exported->losses);
    }
    const absl::Status written = WriteTextFiles(
        exported->files,
        OutputPaths(exported->files, (folder / format.name).string() + "/"),
        true);
    if (!written.ok()) return written;
  }
  return absl::OkStatus();
}

}  // namespace

int WriteResults(Context* context,
                 const std::string& rig_id,
                 const std::string& folder,
                 std::optional<double> imu_rate_hz) {
  DeviceVersion active;
  const grpc::Status read =
      ReadDeviceVersion(context, rig_id, "active", &active);
  if (!read.ok()) return Fail(*context, read);
  const v1::Calibration& calibration = active.message;
  if (calibration.verdict().kind() == v1::Verdict::FACTORY) return kFailed;
  const fs::path to(folder);
  absl::Status written =
      WriteForTools(active.rig, active.theta, to, imu_rate_hz);
  if (written.ok()) {
    written = WriteTextFiles({{"calibration.json", ToJson(calibration, false)}},
                             {(to / "calibration.json").string()},
                             true);
  }
  if (!written.ok()) return FailInput(written);
  const int report = WriteReportFile(
      context,
      {.rig = rig_id, .output = (to / "report.html").string(), .force = true});
  if (report != kDone) return report;
  PrintError(fmt::format("report and files are in {}", folder));
  switch (calibration.verdict().kind()) {
    case v1::Verdict::GOOD:
      return kDone;
    case v1::Verdict::WEAK:
      return kWeak;
    default:
      return kFailed;
  }
}

}  // namespace selfcal::client
