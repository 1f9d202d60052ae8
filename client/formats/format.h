// Calibrations in the files of other tools: read as a rig, written from one.
//
// Each tool has its own frames, quaternion order and IMU matrices;
// docs/formats.md states them with their sources. If a format cannot express
// something, that is an error if nothing useful would be left, and otherwise a
// named loss. These are pure functions of texts, callable from any thread; they
// do not access files.
#pragma once

#include <absl/status/statusor.h>

#include <optional>
#include <string>
#include <vector>

#include "core/model/rig.h"

namespace selfcal::client {

inline constexpr double kNsPerS = 1e9;

struct TextFile {
  std::string name;  // for error messages; without a folder if it is written
  std::string text;
};

// Something that the source of a conversion has and the target cannot express.
struct Loss {
  std::string name;  // "imu", "cam1.time_offset", "sigmas"
  std::string text;  // what the loss means, and what to do
  // True if pixels, readings or times that are predicted from the result differ
  // from those of the source, unless the user does what the text says.
  bool changes_prediction = false;
};

struct FormatOptions {
  // Rate of the IMU [Hz], for tools whose noise is per sample; selfcal does not
  // store it.
  std::optional<double> imu_rate_hz;
};

struct ImportedRig {
  Rig rig;  // id empty, default groups; `factory` is the calibration
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

// Reads the rig that the files of a tool describe; the files may have any names
// and, unless they number the cameras (camera_info), any order.
// INVALID_ARGUMENT for an unknown format and, with the file and the field, for
// files that cannot be parsed or are not a valid calibration.
absl::StatusOr<ImportedRig> ImportRig(const std::string& format,
                                      const std::vector<TextFile>& files,
                                      const FormatOptions& options);

// Writes theta in the files of a tool, with the noise and gravity of the rig.
// INVALID_ARGUMENT for an unknown format, FAILED_PRECONDITION for a calibration
// that the format cannot express.
absl::StatusOr<ExportedFiles> ExportRig(const std::string& format,
                                        const Rig& rig,
                                        const Calibration& theta,
                                        const FormatOptions& options);

}  // namespace selfcal::client
