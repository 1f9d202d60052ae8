#include "client/recording/camera_info_message.h"

#include <absl/status/status.h>
#include <absl/strings/ascii.h>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <string>
#include <vector>

#include "client/formats/format.h"

namespace selfcal::client {
namespace {

std::string MatrixText(const char* key,
                       std::size_t rows,
                       const std::vector<double>& numbers) {
  return fmt::format("{}:\n  rows: {}\n  cols: {}\n  data: [{:.17g}]\n",
                     key,
                     rows,
                     numbers.size() / rows,
                     fmt::join(numbers, ", "));
}

std::string YamlOf(const RosCameraInfo& info) {
  return fmt::format(
             "image_width: {}\nimage_height: {}\n", info.width, info.height) +
         MatrixText("camera_matrix", 3, info.k) +
         fmt::format("distortion_model: {}\n", info.distortion_model) +
         MatrixText("distortion_coefficients", 1, info.d) +
         MatrixText("rectification_matrix", 3, info.r) +
         MatrixText("projection_matrix", 3, info.p);
}

}  // namespace

absl::StatusOr<CameraCalibration> CalibrationOf(const RosCameraInfo& info) {
  if (std::all_of(
          info.k.begin(), info.k.end(), [](double k) { return k == 0; })) {
    return absl::InvalidArgumentError("the camera is not calibrated");
  }
  const bool is_part = (info.roi_width != 0 && info.roi_width != info.width) ||
                       (info.roi_height != 0 && info.roi_height != info.height);
  if (info.binning_x > 1 || info.binning_y > 1 || is_part) {
    return absl::InvalidArgumentError(
        "the images are binned, or a part of what was calibrated");
  }
  const auto is_plain = [](char c) {
    return absl::ascii_isalnum(static_cast<unsigned char>(c)) || c == '_';
  };
  if (info.distortion_model.empty() ||
      !std::all_of(info.distortion_model.begin(),
                   info.distortion_model.end(),
                   is_plain)) {
    return absl::InvalidArgumentError("the distortion model has no name");
  }
  auto imported = ImportRig("camera_info", {{"camera_info", YamlOf(info)}}, {});
  if (!imported.ok()) return imported.status();
  return imported->rig.factory.cameras.at(0);
}

}  // namespace selfcal::client
