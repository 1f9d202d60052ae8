#include "client/formats/format.h"

#include <fmt/format.h>

#include <array>
#include <exception>

#include "client/formats/basalt.h"
#include "client/formats/camera_info.h"
#include "client/formats/kalibr.h"
#include "client/formats/maplab.h"
#include "client/formats/openvins.h"
#include "client/formats/orb_slam3.h"
#include "client/formats/vins_fusion.h"
#include "core/model/temperature.h"

namespace selfcal::client {
namespace {

struct Format {
  const char* name;
  const char* files;  // of a rig with one IMU
  ImportedRig (*import)(const std::vector<TextFile>&, const FormatOptions&);
  ExportedFiles (*write)(const Rig&, const Calibration&, const FormatOptions&);
  bool has_second_imu = false;
};

constexpr std::array kFormats = {
    Format{"kalibr",
           "camchain-imucam.yaml imu.yaml",
           ImportKalibr,
           ExportKalibr,
           true},
    Format{"openvins",
           "kalibr_imucam_chain.yaml kalibr_imu_chain.yaml",
           ImportOpenVins,
           ExportOpenVins},
    Format{"orb_slam3", "orb_slam3.yaml", ImportOrbSlam3, ExportOrbSlam3},
    Format{"vins_fusion",
           "vins_fusion.yaml cam0.yaml cam1.yaml",
           ImportVinsFusion,
           ExportVinsFusion},
    Format{"basalt", "calibration.json", ImportBasalt, ExportBasalt},
    Format{"maplab", "sensors.yaml", ImportMaplab, ExportMaplab},
    Format{"camera_info",
           "cam0.yaml cam1.yaml",
           ImportCameraInfo,
           ExportCameraInfo}};

absl::StatusOr<const Format*> FindFormat(const std::string& name) {
  std::vector<std::string> known;
  for (const Format& format : kFormats) {
    if (format.name == name) return &format;
    known.emplace_back(format.name);
  }
  return absl::InvalidArgumentError(fmt::format(
      "format '{}' must be one of {}", name, fmt::join(known, ", ")));
}

std::string Names(const std::vector<TextFile>& files) {
  std::vector<std::string> names;
  for (const TextFile& file : files) names.push_back(file.name);
  return fmt::format("{}", fmt::join(names, " "));
}

absl::Status CheckOptions(const FormatOptions& options) {
  constexpr double kMost_hz = 1e6;
  if (!options.imu_rate_hz ||
      (*options.imu_rate_hz > 0 && *options.imu_rate_hz <= kMost_hz)) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError("the IMU's rate must be above 0 Hz");
}

absl::Status Check(const Rig& rig, const std::string& files) {
  const std::vector<Violation> faults = Validate(rig.factory, "");
  if (faults.empty()) return absl::OkStatus();
  return absl::InvalidArgumentError(
      fmt::format("{}: {} {}", files, faults[0].field, faults[0].message));
}

// Makes w of FOV models positive, as maplab requires; the model is even in w.
Calibration WithPositiveFov(Calibration theta) {
  for (CameraCalibration& camera : theta.cameras) {
    if (camera.model != DistortionModel::kFov) continue;
    camera.distortion = camera.distortion.cwiseAbs();
  }
  return theta;
}

}  // namespace

std::vector<FormatInfo> Formats() {
  std::vector<FormatInfo> infos;
  for (const Format& format : kFormats) {
    infos.push_back({format.name, format.files});
  }
  return infos;
}

absl::StatusOr<ImportedRig> ImportRig(const std::string& format,
                                      const std::vector<TextFile>& files,
                                      const FormatOptions& options) {
  const auto found = FindFormat(format);
  if (!found.ok()) return found.status();
  if (absl::Status status = CheckOptions(options); !status.ok()) return status;
  try {
    ImportedRig result = (*found)->import(files, options);
    if (absl::Status status = Check(result.rig, Names(files)); !status.ok()) {
      return status;
    }
    return result;
  } catch (const std::exception& error) {
    return absl::InvalidArgumentError(
        fmt::format("{}: {}", Names(files), error.what()));
  }
}

absl::StatusOr<ExportedFiles> ExportRig(const std::string& format,
                                        const Rig& rig,
                                        const Calibration& theta,
                                        const FormatOptions& options) {
  const auto found = FindFormat(format);
  if (!found.ok()) return found.status();
  if (absl::Status status = CheckOptions(options); !status.ok()) return status;
  const std::vector<Violation> faults = Validate(theta, "");
  if (!faults.empty()) {
    return absl::InvalidArgumentError(
        fmt::format("{} {}", faults[0].field, faults[0].message));
  }
  try {
    const double reference_c = theta.reference_temperature_c;
    ExportedFiles result = (*found)->write(
        rig, WithPositiveFov(AtTemperature(theta, reference_c)), options);
    if (theta.imu1 && !(*found)->has_second_imu) {
      result.losses.push_back(
          {"imu1",
           fmt::format("these files of {} have one IMU, the first: omitted",
                       format),
           true});
    }
    if (HasSlopes(theta)) {
      result.losses.push_back(
          {"slopes",
           fmt::format(
               "{} has no slopes with temperature: the values are those "
               "at {} deg C; export those of your temperature with "
               "--temperature",
               format,
               reference_c),
           true});
    }
    result.losses.push_back(
        {"sigmas",
         fmt::format("{} has no uncertainty: `selfcal calibration show` has it",
                     format),
         false});
    return result;
  } catch (const std::exception& error) {
    return absl::FailedPreconditionError(error.what());
  }
}

}  // namespace selfcal::client
