// Calibrations in the files of other tools: read as a rig, written from one.
//
// Each tool has its own frames, its own order of a quaternion, and its own
// matrices of the IMU; docs/formats.md states them with their sources. What a
// format cannot express is an error where nothing useful would be left, and
// otherwise a loss with a name. Pure functions of texts, callable from any
// thread; nothing is read or written here.
#pragma once

#include <absl/status/statusor.h>

#include <optional>
#include <string>
#include <vector>

#include "core/model/rig.h"

namespace selfcal::client {

struct TextFile {
  std::string name;  // as errors name it; where it is written: without a folder
  std::string text;
};

// What one side has and the other cannot say.
struct Loss {
  std::string name;  // "imu", "cam1.time_offset", "sigmas"
  std::string text;  // what that means, and what to do
  // Pixels, readings or times predicted from the result differ from those of
  // the source, unless that is done.
  bool changes_prediction = false;
};

struct FormatOptions {
  // Of the IMU [Hz]; selfcal keeps none, some tools' noise is by sample.
  std::optional<double> imu_rate_hz;
};

struct ImportedRig {
  Rig rig;  // id empty, groups the default; factory is the calibration
  std::vector<Loss> losses;
};

struct ExportedFiles {
  std::vector<TextFile> files;
  std::vector<Loss> losses;
};

struct FormatInfo {
  std::string name;   // "kalibr"
  std::string files;  // "camchain-imucam.yaml imu.yaml"
};
std::vector<FormatInfo> Formats();

// The rig that the files of a tool describe, in any order and with any names.
// INVALID_ARGUMENT for an unknown format, and for what cannot be read or is no
// valid calibration, with the file and the field.
absl::StatusOr<ImportedRig> ImportRig(const std::string& format,
                                      const std::vector<TextFile>& files,
                                      const FormatOptions& options);

// theta in the files of a tool, with the noise and gravity of the rig.
// INVALID_ARGUMENT for an unknown format, FAILED_PRECONDITION for a calibration
// that it has no words for.
absl::StatusOr<ExportedFiles> ExportRig(const std::string& format,
                                        const Rig& rig,
                                        const Calibration& theta,
                                        const FormatOptions& options);

}  // namespace selfcal::client
